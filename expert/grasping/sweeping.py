"""Execution of a grasp without friction: where do finger paths push the object?  (Thesis 5.2.5, simulated experiments.)

Quasi-static motion on a support is a sweeping process (Moreau): the object moves as little as it can, in the metric of
its support, while the fingers do not enter it.  Each step moves the fingers, then the pose to the nearest free one:

    min |q' - q|_B   subject to   max or min over nearby facets f of  g_nf(q') = n_f . y_n(q') - d_f  >= 0

with y_n the finger in the body frame: all facets that meet at a reflex corner, one of those that meet at a convex one.
Lengths are over the object's diameter, poses relative to the goal.  Where no free pose is near, the object is jammed.
"""

from dataclasses import dataclass

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.polygon import facet_frames, facets, mass_properties, reflex_vertices
from expert.geometry.pose import Array
from expert.grasping.sweep_kernel import FACET, NEARBY, Law, sweep_all
from expert.world.frame import Frame
from expert.world.shape import Shape
from expert.world.values import readonly, require

STEP = 3e-4
"""Largest finger motion of a step, over the object's diameter."""
SAMPLES = 40
"""Recorded poses per knot interval."""
NEAR, TURNED = 1e-5, np.radians(0.01)
"""An end this near to the goal, over the object's diameter and in rad, is there."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """M executions, recorded at S path parameters.

    s (S,) in [0, K - 1].  poses (M, S, 3) [m, rad], world; after a stall the last one stays.  stalled (M,): path parameter
    at which the object jammed, nan where it did not.
    """

    s: Array
    poses: Array
    stalled: Array

    @property
    def ends(self) -> Array:
        """Last poses (M, 3)."""
        return self.poses[:, -1]

    def misses(self, goal: Array) -> tuple[Array, Array]:
        """Distance [m] of the body frame's origin and angle [rad] from a goal pose (3,) at the end, each (M,)."""
        off = self.ends - goal
        return np.linalg.norm(off[:, :2], axis=1), np.abs(off[:, 2])

    def arrived(self, goal: Array, size: float) -> np.ndarray:
        """Which executions (M,) of an object of this diameter [m] end at a goal pose (3,)."""
        distance, angle = self.misses(goal)
        return (distance <= NEAR * size) & (angle <= TURNED)


def sweep(
    shape: Shape,
    path: Array,
    starts: Array,
    *,
    goal: Array | None = None,
    metric: Array | None = None,
    step: float = STEP,
    samples: int = SAMPLES,
) -> Sweep:
    """Execute finger paths (K, N, 2) [m], straight between the knots, from start poses (M, 3).

    goal (3,): the pose about which lengths are small (by default 0).  metric (3, 3): positive definite form of body twists
    (vx, vy [over the diameter], omega) about the centroid that the support resists, by default that of a uniform disc of
    the polygon's radius of gyration.  Raises InvalidProblem for starts with a finger inside the object.
    """
    path = readonly(path, (None, None, 2), "path")
    starts = readonly(starts, (None, 3), "starts")
    goal = np.zeros(3) if goal is None else readonly(goal, (3,), "goal")
    require(len(path) >= 2, "path", "at least 2 knots", len(path))
    require(0 < step <= NEARBY / 4, "step", f"a length over the diameter of at most {NEARBY / 4:g}", step)
    lengths = _Lengths(shape, goal)
    frame = lengths.frame
    times = np.linspace(0, len(path) - 1, (len(path) - 1) * samples + 1)
    relative = np.ascontiguousarray(frame.relative(path))
    law = Law(relative, lengths.facets(), lengths.metric_root(metric), lengths.radius, step)
    poses, stalled = sweep_all(law, frame.configuration(starts), times)
    if (inside := np.flatnonzero(stalled < 0)).size:
        raise InvalidProblem(
            f"starts[{inside[0]}]", expected="a pose that no finger enters", got="one with a finger inside"
        )
    return Sweep(s=times, poses=frame.world_pose(poses), stalled=stalled)


class _Lengths:
    """Lengths over the diameter; origin at the centroid of the object in its goal pose, whose angle counts as 0."""

    def __init__(self, shape: Shape, goal: Array) -> None:
        plate = mass_properties(shape.vertices)
        self.frame = Frame(plate.centroid, shape.size, goal)
        self.vertices = self.frame.body(shape.vertices)
        self.gyration = np.sqrt(plate.second_moment / plate.area) / shape.size
        self.radius = float(np.linalg.norm(self.vertices, axis=1).max())

    def facets(self) -> np.ndarray:
        """Of the object, as the kernel wants them (V,)."""
        a, b = facets(self.vertices)
        inward, tangent = facet_frames(self.vertices)
        length = np.linalg.norm(b - a, axis=1)
        columns = (*a.T, *-inward.T, *tangent.T, length, reflex_vertices(self.vertices))
        return np.rec.fromarrays(columns, dtype=FACET).view(np.ndarray)

    def metric_root(self, metric: Array | None) -> Array:
        """Inverse transposed root W of the metric B = U^T U: a gradient a becomes W a where twists become U xi."""
        B = np.diag([1.0, 1.0, self.gyration**2]) if metric is None else readonly(metric, (3, 3), "metric")
        definite = bool(np.allclose(B, B.T) and np.linalg.eigvalsh(B).min() > 0)
        require(definite, "metric", "a symmetric positive definite matrix", B.tolist())
        return np.ascontiguousarray(np.linalg.inv(np.linalg.cholesky(B)))
