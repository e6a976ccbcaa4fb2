"""From perceived geometry to a contact task, with the margins that make up for what perception may have wrong."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from datasets.motions import TaskSettings
from dlm.perception import Perceived
from expert.geometry.pose import Array, moved_origin, to_world
from expert.problems.contact import ContactTask
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.values import require

FACET_MARGIN = 0.2
"""Share of a facet kept free at either end: perceived corners are off by a part of a pixel, and may be superfluous."""

LESS_MARGIN = (0.1, 0.05)
SAFER = ((0.7, 0.0), (1.0, 0.12), (0.7, 0.12))
"""Shares of the friction planned with, and least pushes over m g."""


@dataclass(frozen=True, kw_only=True)
class Planning:
    """What planning assumes beyond what is seen.

    tasks: mass, friction, time step, fingers and margins; its facet_margin, cone_fraction and least_push are those planned with.
    """

    tasks: TaskSettings = field(default_factory=lambda: TaskSettings(facet_margin=FACET_MARGIN))

    def task(self, vertices: Array, poses: Array) -> ContactTask:
        """The task of moving a uniform object, vertices (V, 2) about its centroid, along poses (T, 3) over the floor y = 0.

        Raises InvalidProblem for another number of poses, and for what makes no polygon.
        """
        steps = self.tasks.steps
        require(len(poses) == steps, "poses", f"{steps}", len(poses), f"resample the video to {steps} frames")
        body, centroid = Body.uniform(vertices, self.tasks.mass)
        centred = moved_origin(poses, centroid)
        depth = -to_world(centred, body.vertices)[..., 1].min(axis=1)
        centred[:, 1] += np.maximum(depth, 0.0)
        return self.tasks.task(body, Trajectory.of(centred, self.tasks.dt, "rest"))

    def of(self, perceived: Perceived) -> ContactTask:
        """The task that is seen."""
        return self.task(perceived.vertices, perceived.poses)

    def variants(self) -> Iterator["Planning"]:
        """This planning; then with margins given up one after the other, for motions without a plan that keeps them; then
        with firmer and steeper pushes, for plans that fail when they are tried out."""
        own = self.tasks
        margins = [m for m in (own.facet_margin, *LESS_MARGIN) if m <= own.facet_margin]
        for facet_margin in dict.fromkeys(margins):
            for least_push in dict.fromkeys((own.least_push, 0.0)):
                yield replace(self, tasks=replace(own, facet_margin=facet_margin, least_push=least_push))
        for cone, push in SAFER:
            firmer = max(own.least_push, push)
            yield replace(self, tasks=replace(own, cone_fraction=cone * own.cone_fraction, least_push=firmer))
