"""What L_sim may tune without labels: where the camera is, how outlines are blown up and blurred, and with what margins to plan."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from dlm.perception import Perceived
from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array, to_world
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Corrections; all zero: none.

    shift_x, shift_y: where the camera really is, over where it is said to be [m].  inflation: outlines appear this much
    too far out [m].  blur: of the camera, added to the known one [pixels].  margin, cone, push: added to the planner's
    facet_margin, cone_fraction and least_push.
    """

    shift_x: float = 0.0
    shift_y: float = 0.0
    inflation: float = 0.0
    blur: float = 0.0
    margin: float = 0.0
    cone: float = 0.0
    push: float = 0.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            require(abs(value) < np.inf, f"calibration.{f.name}", "a finite number", value)

    @classmethod
    def of(cls, knobs: ArrayLike) -> "Calibration":
        """From one number per field, in its UNITS."""
        return cls(**dict(zip(NAMES, (np.asarray(knobs, dtype=float) * UNITS).tolist(), strict=True)))


NAMES = tuple(f.name for f in fields(Calibration))
UNITS = np.array([1e-3, 1e-3, 5e-4, 0.5, 0.1, 0.1, 0.04])
"""Changes of about equal effect."""
STAYS = 2e-5
"""Gaps and slips below this count as zero [m]."""
SHARPEST = 0.1
"""1 + cos of the sharpest turn of an outline that is moved in as far as it should be."""


def deflated(perceived: Perceived, distance: float) -> Perceived:
    """What casts an outline blown up by `distance` [m]; what touched the floor touches it, what stayed in its place on it stays."""
    if distance == 0:
        return perceived
    vertices = inset(perceived.vertices, distance)
    before = to_world(perceived.poses, perceived.vertices)
    poses = perceived.poses.copy()
    touching = before[..., 1] <= STAYS  # (T, V)
    for t in range(len(poses)):
        if touching[t].any():
            poses[t, 1] -= to_world(poses[t], vertices)[:, 1].min()
        if t > 0:
            slip = np.abs(before[t, :, 0] - before[t - 1, :, 0])
            steady = np.flatnonzero(touching[t] & touching[t - 1] & (slip <= STAYS))
            if len(steady):
                now, then = to_world(poses[t - 1 : t + 1], vertices)[:, steady[0], 0]
                poses[t, 0] += now - then
    return replace(perceived, vertices=vertices, poses=poses)


def inset(vertices: Array, distance: float) -> Array:
    """Every side (V, 2) moved inwards; a negative distance moves it out."""
    normal, _ = facet_frames(vertices)
    before = np.roll(normal, 1, axis=0)
    spread = 1 + (normal * before).sum(axis=1, keepdims=True)
    return vertices + distance * (normal + before) / np.maximum(spread, SHARPEST)
