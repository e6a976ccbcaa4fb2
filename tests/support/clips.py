"""Video files written by OpenCV, as a user would have them."""

from pathlib import Path

import cv2
import numpy as np

from datasets.render import Camera, Colour, Frames, Palette, render
from datasets.specification import Sample
from expert.geometry.pose import Array

SIZE, SCALE = 200, 0.001
"""Side of the pictures [pixels], metres per pixel: the data sets' view at a finer resolution."""
CAMERA = Camera(size=SIZE, scale=SCALE)


def drawn(vertices: Array, poses: Array, palette: Palette | None = None) -> Frames:
    return render(vertices, poses, CAMERA, palette)


def write_clip(path: Path, frames: Frames, rate: float = 10.0, codec: str = "mp4v") -> Path:
    height, width = frames.shape[1:3]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), rate, (width, height))
    for frame in frames:
        writer.write(np.ascontiguousarray(frame[..., ::-1]))
    writer.release()
    assert path.stat().st_size > 0
    return path


def with_discs(frames: Frames, centres: Array, colour: Colour, radius: float = 4.0) -> Frames:
    """A disc in every frame, at centres (T, 2) (column, row) [pixels]."""
    y, x = np.indices(frames.shape[1:3]) + 0.5
    out = np.empty_like(frames)
    for t, (column, row) in enumerate(centres):
        share = np.clip(radius + 0.5 - np.hypot(x - column, y - row), 0, 1)[..., None]
        out[t] = np.rint(frames[t] + share * (np.array(colour) - frames[t]))
    return out


def with_fingers(sample: Sample, colour: Colour) -> Frames:
    """The sample's video with round fingers where the expert's plan has them, just outside the object."""
    poses = sample.task.trajectory.poses
    frames = drawn(sample.task.body.vertices, poses)
    for c in range(sample.plan.positions.shape[1]):
        arm = sample.plan.positions[:, c] - poses[:, :2]
        outside = sample.plan.positions[:, c] + 0.004 * arm / np.linalg.norm(arm, axis=1, keepdims=True)
        frames = with_discs(frames, CAMERA.to_pixels(outside), colour)
    return frames
