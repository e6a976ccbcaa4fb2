"""Training examples for the scorer: geometry and class of a labelled task, mirrored and with split facets at random.

Mirroring swaps left and right.  Splitting turns objects of 4 to 6 facets into ones of up to 12, some of them collinear: what a
network must cope with on finer polygons, and on superfluous corners that perception leaves.
"""

from dataclasses import dataclass, replace

import numpy as np

from datasets.specification import Sample
from dlm.structured.classes import Schedules
from expert.geometry.pose import Array, to_body
from expert.problems.contact import FREE
from expert.world.values import IntArray

MOST_FACETS = 12
SPLIT_BETWEEN = (0.25, 0.75)
"""Where facets are split, as shares of their length."""


@dataclass(frozen=True)
class Example:
    """vertices (V, 2) body frame, poses (T, 3), modes (T, C) and places rho (T, C) of the expert's plan."""

    vertices: Array
    poses: Array
    modes: IntArray
    rho: Array

    @classmethod
    def of(cls, sample: Sample) -> "Example":
        """A labelled task as it is."""
        vertices, poses = sample.task.body.vertices, sample.task.trajectory.poses
        facet = np.maximum(sample.plan.modes, 0)
        a, b = vertices[facet], vertices[(facet + 1) % len(vertices)]
        along, arm = b - a, to_body(poses, sample.plan.positions) - a
        rho = (arm * along).sum(-1) / (along * along).sum(-1)
        return cls(vertices, poses, sample.plan.modes, rho)

    def mirrored(self) -> "Example":
        """Left and right exchanged; facet k from vertex k to k + 1 becomes facet V - 1 - k of the reversed order."""
        flip = np.array([-1.0, 1.0])
        last = len(self.vertices) - 1
        # The reversed order starts at the old last vertex + 1 = vertex 0, so that facet indices simply turn round.
        vertices = np.roll(self.vertices[::-1] * flip, 1, axis=0)
        modes = np.where(self.modes == FREE, FREE, last - self.modes)
        return Example(vertices, self.poses * [-1, 1, -1], modes, 1 - self.rho)

    def split(self, rng: np.random.Generator, facets: int) -> "Example":
        """Extra vertices on random facets until there are so many facets."""
        example = self
        while len(example.vertices) < facets:
            v = example.vertices
            lengths = np.linalg.norm(np.roll(v, -1, axis=0) - v, axis=1)
            k = int(rng.choice(len(v), p=lengths / lengths.sum()))
            example = example.split_at(k, float(rng.uniform(*SPLIT_BETWEEN)))
        return example

    def split_at(self, k: int, share: float) -> "Example":
        """Facet k in two at this share of its length."""
        v = self.vertices
        corner = v[k] + share * (v[(k + 1) % len(v)] - v[k])
        here, beyond = self.modes == k, self.rho > share
        modes = self.modes + (self.modes > k) + (here & beyond)
        rho = np.where(here, np.where(beyond, (self.rho - share) / (1 - share), self.rho / share), self.rho)
        return replace(self, vertices=np.insert(v, k + 1, corner, axis=0), modes=modes, rho=rho)

    def varied(
        self, rng: np.random.Generator, *, splitting: bool = True, mirroring: bool = True
    ) -> "Example":
        """Mirrored half of the time, and split half of the time."""
        example = self.mirrored() if mirroring and rng.random() < 0.5 else self
        if splitting and rng.random() < 0.5 and len(example.vertices) < MOST_FACETS:
            example = example.split(rng, int(rng.integers(len(example.vertices) + 1, MOST_FACETS + 1)))
        return example

    def contact_class(self, schedules: Schedules) -> tuple[int, int, int] | None:
        """The class of the plan, if the vocabulary has it."""
        return schedules.class_of(self.modes)
