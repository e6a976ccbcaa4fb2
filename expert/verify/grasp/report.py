"""What the checker of grasps answers, part by part."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.start_set import StartSet
from expert.verify.report import Report

Verdict = Literal["certified", "refuted", "unknown"]


@dataclass(frozen=True, kw_only=True)
class Cages:
    """Nested cages: the thesis's conditions (5-CT12 to 5-CT15, 5.2 Remark 2), whatever the dead ends say.

    half_ranges (K,), knot_ranges (K, 2) [rad]: what was asked for, and the orientations relative to the goal that can be
    reached at each knot, from outside; nan: not shown to be caged.  samples (M, 2), ranges (M, 2): parameters of the
    slabs between the knots and the orientations [rad] that they reach.  leak: parameters of a slab in which what can be
    reached is not bounded at the finest resolution.
    """

    half_ranges: Array
    knot_ranges: Array
    samples: Array = field(default_factory=lambda: np.empty((0, 2)))
    ranges: Array = field(default_factory=lambda: np.empty((0, 2)))
    leak: tuple[float, float] | None = None

    @property
    def nested(self) -> bool:
        """Whether each knot's cage is within its half-range."""
        return bool((np.abs(self.knot_ranges) <= self.half_ranges[:, None] + 1e-9).all())

    @property
    def held(self) -> bool:
        """Whether the knots' cages are nested, and all that can be reached is bounded at every s."""
        return self.nested and self.leak is None and len(self.samples) > 0

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        known = np.isfinite(self.knot_ranges[:, 0])
        return {
            "held": self.held,
            "half_ranges": self.half_ranges.tolist(),
            "knot_ranges": [
                r if ok else None for r, ok in zip(self.knot_ranges.tolist(), known, strict=True)
            ],
            "samples": self.samples.tolist(),
            "ranges": self.ranges.tolist(),
            "leak": list(self.leak) if self.leak else None,
        }

    def __str__(self) -> str:
        ends = ", ".join(f"[{low:.4g}, {high:.4g}]" for low, high in np.degrees(self.knot_ranges))
        if self.leak:
            return f"cages      may open for s in [{self.leak[0]:.4g}, {self.leak[1]:.4g}]; at the knots {ends} deg"
        return f"cages      {'nested' if self.nested else 'NOT nested'}: {ends} deg, {len(self.samples)} slabs between"


@dataclass(frozen=True, kw_only=True)
class DeadEnd:
    """The object jams at path parameter s at a world pose (3,), between contacts (finger, facet).

    witness: a start (3,) that certainly ends there: it is in Q0 and no finger touches it before.
    """

    s: float
    pose: Array
    contacts: tuple[tuple[int, int], ...]
    witness: Array | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "s": self.s,
            "pose": self.pose.tolist(),
            "contacts": [list(c) for c in self.contacts],
            "witness": None if self.witness is None else self.witness.tolist(),
        }


@dataclass(frozen=True, kw_only=True)
class DeadEnds:
    """no_jam: no dead end can be reached.  may_jam: some of `events` can, or could not be excluded.

    listed: dead ends along the path, reachable or not.
    """

    verdict: Literal["no_jam", "may_jam"]
    events: tuple[DeadEnd, ...] = ()
    listed: int = 0

    @property
    def witness(self) -> Array | None:
        """A start (3,) that certainly jams, if one is known."""
        return next((e.witness for e in self.events if e.witness is not None), None)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"verdict": self.verdict, "listed": self.listed, "events": [e.as_dict() for e in self.events]}

    def __str__(self) -> str:
        if self.verdict == "no_jam":
            return f"dead ends  no_jam: none of {self.listed} can be reached"
        if not self.events:
            return "dead ends  may_jam: what can be reached is not bounded"
        first = self.events[0]
        sure = "with a witness start" if self.witness is not None else "not shown to be unreachable"
        return (
            f"dead ends  may_jam: {len(self.events)} of {self.listed}, the first at s = {first.s:.4g}, {sure}"
        )


@dataclass(frozen=True, kw_only=True)
class EndGrasp:
    """contacts: (finger, facet) at the goal.  form_closure: 0 none, 1 first order, 2 second order.

    observability_rank: of the proprioceptive sensors (3: the pose is seen to first order).  extent: translation [m] and
    rotation [rad] that the last component allows.  alone: whether nothing else can be reached at the end.
    """

    contacts: tuple[tuple[int, int], ...]
    form_closure: int
    observability_rank: int
    extent: tuple[float, float]
    alone: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values; an extent without bound is null."""
        return {
            "contacts": [list(c) for c in self.contacts],
            "form_closure": self.form_closure,
            "observability_rank": self.observability_rank,
            "extent": [x if np.isfinite(x) else None for x in self.extent],
            "alone": self.alone,
        }

    def __str__(self) -> str:
        order = ("no", "first-order", "second-order")[self.form_closure]
        shift, turn = self.extent[0], np.degrees(self.extent[1])
        return (
            f"end        {order} form closure, sensor rank {self.observability_rank}, "
            f"moves by at most {shift:.2g} m and {turn:.2g} deg{', alone' if self.alone else ''}"
        )


@dataclass(frozen=True, kw_only=True)
class GraspReport(Report):
    """Verdict on a finger path; parts that were not looked at are None.  spent: processor time [s] by part."""

    certificate = "certified_grasp"

    verdict: Verdict
    cages: Cages | None = None
    dead_ends: DeadEnds | None = None
    end: EndGrasp | None = None
    start: StartSet | None = None
    spent: dict[str, float] = field(default_factory=dict)

    @property
    def certified(self) -> bool:
        """Whether every start in Q0 ends at the goal."""
        return self.verdict == "certified"

    def evidence(self) -> dict[str, Any]:
        """The parts."""
        parts = {"cages": self.cages, "dead_ends": self.dead_ends, "end": self.end, "start": self.start}
        return {name: part.as_dict() if part else None for name, part in parts.items()} | {
            "spent": self.spent
        }

    def lines(self) -> list[str]:
        """The verdict, then the parts."""
        head = f"{self.verdict}: {self.reason or 'every start in Q0 ends at the goal'}"
        parts = (self.cages, self.dead_ends, self.end, self.start)
        return [head, *(str(part) for part in parts if part is not None)]
