"""Outcomes of straight pushes of a block by a driven disc, by the exact model of `expert.pushing.impulses`."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from expert.geometry.pose import Array, rotation
from expert.pushing.drive import Drive, gains
from expert.pushing.impulses import ANGLE, FX, FY, Block, Law, X, substep
from expert.pushing.outline import Outline, outline
from expert.world.shape import Shape
from expert.world.values import IntArray

AT_REST = 0.004
"""Fraction of a push's speed that a block may slide on: below, it is called at rest."""


@dataclass(frozen=True)
class ImpulseModel:
    """Pushes from rest to rest (see `expert.pushing.table`): the finger speeds up, stops, and waits until the block rests.

    speed: way of the finger per control step.  Poses are those of the shape's frame moved to `reference` (2,); None: the
    centre of gravity.
    """

    block: Block
    drive: Drive
    speed: float = 60.0
    reference: Array | None = None

    @cached_property
    def law(self) -> Law:
        """The numbers of the compiled model, about the centre of gravity."""
        return self.block.law(self.drive)

    @property
    def shape(self) -> Shape:
        return self.block.shape

    @property
    def origin(self) -> Array:
        """The moving frame's origin in the shape's frame."""
        return self.block.centre if self.reference is None else self.reference

    @cached_property
    def edges(self) -> Outline:
        """The outline about the origin."""
        return outline(self.shape, self.origin)

    @property
    def radius(self) -> float:
        return self.drive.radius

    @cached_property
    def offset(self) -> Array:
        """The centre of gravity (2,) in the moving frame."""
        return self.block.centre - self.origin

    @cached_property
    def waits(self) -> int:
        """Control steps after a push, until the block has come to rest."""
        if self.block.kept == 0:
            return 0
        return int(np.ceil(np.log(AT_REST) / np.log(self.block.kept) / self.drive.substeps))

    @property
    def slide(self) -> float:
        """How long the block slides on at the speed that it has [control steps]."""
        return self.block.kept / (1 - self.block.kept) / self.drive.substeps

    def centre_pose(self, poses: Array) -> Array:
        """Poses (..., 3) of the centre of gravity, from those of the moving frame."""
        return shifted(poses, self.offset)

    def frame_pose(self, poses: Array) -> Array:
        """Poses (..., 3) of the moving frame, from those of the centre of gravity."""
        return shifted(poses, -self.offset)

    def steps(self, lengths: Array) -> IntArray:
        """Control steps of pushes of given lengths: one to start and stop, one for each `speed` of way, and the wait."""
        return 1 + self.waits + np.maximum(np.ceil(lengths / self.speed), 1).astype(np.int64)

    def weights(self, steps: int) -> Array:
        """Commands of a push that takes so many steps (steps,), as fractions of its way."""
        return np.concatenate([gains(self.drive, steps - self.waits, ())[:, 2], np.ones(self.waits)])

    def leads(self, lengths: Array) -> Array:
        """How far the commands of such pushes reach beyond their starts (N,)."""
        farthest = {n: self.weights(n).max() for n in np.unique(self.steps(lengths))}
        return lengths * np.array([farthest[n] for n in self.steps(lengths)])

    def outcomes(self, starts: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
        """Pose changes (N, 3) of the block, and where the finger ends in its new frame (N, 2)."""
        steps = self.steps(lengths)
        longest = steps.max(initial=0)
        weights = np.zeros((longest + 1, longest))
        for n in np.unique(steps):
            weights[n, :n] = self.weights(int(n))
        moves = np.ascontiguousarray(lengths[:, None] * directions)
        places, fingers = _outcomes(
            self.law, np.ascontiguousarray(starts) - self.offset, moves, steps, weights, self.drive.substeps
        )
        places[:, :2] += self.offset
        return self.frame_pose(places), fingers + self.offset


def shifted(poses: Array, offset: Array) -> Array:
    """Poses (..., 3) of a frame moved by an offset (2,) in its own axes."""
    moved = poses[..., :2] + offset @ np.swapaxes(rotation(poses[..., 2]), -1, -2)
    return np.concatenate([moved, poses[..., 2:]], axis=-1)


@njit(cache=True, error_model="numpy")
def _outcomes(
    law: Law, starts: Array, moves: Array, steps: IntArray, weights: Array, substeps: int
) -> tuple[Array, Array]:
    """Poses (N, 3) of the centre of gravity, at first 0, and the finger in the new frame (N, 2)."""
    poses, fingers = np.empty((len(starts), 3)), np.empty((len(starts), 2))
    for i in range(len(starts)):
        s = np.zeros(13)
        s[FX], s[FY] = starts[i]
        for k in range(steps[i]):
            w = weights[steps[i], k]
            x, y = starts[i, 0] + w * moves[i, 0], starts[i, 1] + w * moves[i, 1]
            for _ in range(substeps):
                substep(law, s, x, y)
        poses[i] = s[X : X + 3]
        c, sn = np.cos(s[ANGLE]), np.sin(s[ANGLE])
        rx, ry = s[FX] - s[X], s[FY] - s[X + 1]
        fingers[i] = c * rx + sn * ry, c * ry - sn * rx
    return poses, fingers
