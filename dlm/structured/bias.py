"""Videos of a camera that is not quite what the model takes it for: what calibration is there to find out."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from datasets.disturb import blurred
from datasets.render import Camera, Frames, render
from dlm.structured.calibration import inset
from dlm.tasks import TaskBatch
from expert.world.shape import Body
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Bias:
    """How the camera differs: shifted to the right and up [m], outlines blown up (as overexposure does) [m], out of focus [pixels]."""

    shift_x: float = 0.0
    shift_y: float = 0.0
    inflation: float = 0.0
    blur: float = 0.0

    def __post_init__(self) -> None:
        require(abs(self.shift_x) < np.inf, "bias.shift_x", "a finite length", self.shift_x)
        require(abs(self.shift_y) < np.inf, "bias.shift_y", "a finite length", self.shift_y)
        require(0 <= self.inflation < 0.01, "bias.inflation", "a length from 0 to 0.01 m", self.inflation)
        require(0 <= self.blur <= 5, "bias.blur", "0 to 5 pixels", self.blur)

    def video(self, body: Body, poses: np.ndarray, camera: Camera) -> Frames:
        """What it shows of an object, where `camera` is meant."""
        real = replace(camera, centre=camera.centre + self.shift_x, below=camera.below - self.shift_y)
        frames = render(inset(body.vertices, -self.inflation), poses, real)
        return blurred(frames, self.blur) if self.blur else frames

    def videos(self, tasks: TaskBatch, camera: Camera) -> TaskBatch:
        """The same tasks, seen by it."""
        seen = [self.video(s.task.body, s.task.trajectory.poses, camera) for s in tasks.samples]
        samples = tuple(replace(s, video=v) for s, v in zip(tasks.samples, seen, strict=True))
        return replace(tasks, video=torch.from_numpy(np.stack(seen)), samples=samples)


STATED = Bias(shift_x=2e-3, shift_y=1e-3, inflation=8e-4)
"""Half a pixel to the side, a quarter up, outlines a fifth of a pixel too far out."""
