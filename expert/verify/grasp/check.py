"""Does every start in a cage end in one grasp?  Independent of how the finger path was found (Thesis 5.2).

Fingers move slowly and without friction: the object rests until it is touched and then yields, by whatever support
friction, within its free space F(s).  Where all that it can reach is bounded, it stops only where a part of free space
vanishes: at a local maximum of s over {(q, s): q in F(s)}.  So if none of these can be reached, and nothing but the goal
can be at the end, every start in Q0, the goal's component of F(0), ends at the goal.

cages      at each knot the goal is caged within the half-range asked for: the thesis's conditions, which do not suffice;
           everything that can be reached from Q0 stays bounded in between
dead ends  the local maxima of s, exactly, and whether what can be reached meets them
end        contacts in form closure, and of all that can be reached only the goal is left
start      Q0, from inside
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from expert.budget import UNLIMITED, Budget
from expert.errors import InvalidProblem, OutOfTime, SolverFailed
from expert.geometry.pose import Array, wrapped
from expert.problems.cage import START_TOLERANCE
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.cage.check import verify_cage
from expert.verify.grasp.claims import CLAIMED, cost_fault, gripper_fault
from expert.verify.grasp.dead_ends import DeadEndEvent, dead_end_events
from expert.verify.grasp.end_grasp import (
    NOT_ISOLATED,
    form_closure,
    gap_gradients,
    isolation,
    observability_rank,
    touching,
)
from expert.verify.grasp.event_kernel import TOUCH
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.pockets import Pockets
from expert.verify.grasp.reach_tube import COARSEST, FINEST, Tube, reach_tube, settled_slab
from expert.verify.grasp.report import Cages, DeadEnd, DeadEnds, EndGrasp, GraspReport, Verdict
from expert.verify.grasp.slab import uniform_ring
from expert.verify.grasp.start_set import StartSet
from expert.world.values import readonly

TIGHT, WIDE = np.radians([2, 10])
"""What can be reached may leave a knot's half-range by the one, or else the first one's by the other, before it leaks."""
KNOT_RESOLUTION = np.radians(1 / 16)
"""To which the orientations that can be reached at a knot are located."""
NO_STARTS = np.empty((0, 2))
ROUNDS = 3
"""What can be reached is computed with cells so often a quarter as wide, while that may yet exclude a dead end."""


def verify(task: GraspProblem, answer: GraspSolution | None = None) -> GraspReport:
    """Report on the finger path that an answer claims to be a certified grasp.

    Raises InvalidProblem where there is none to check.
    """
    if answer is None:
        raise InvalidProblem("fingers", expected="paths to verify", got="nothing", remedy="solve it first")
    if len(answer.path) == 0 or answer.status in ("none_found", "time_limit"):
        raise InvalidProblem(
            "status", expected="finger paths", got=answer.status, remedy="there is no claim to check"
        )
    report = replace(
        verify_grasp(task, answer.path, answer.facets, starts=answer.starts),
        claim=answer.status,
        claimed=CLAIMED,
    )
    if fault := cost_fault(task, answer):
        report = replace(report, verdict="refuted", reason="; ".join(filter(None, [report.reason, fault])))
    return report


def verify_grasp(
    problem: GraspProblem,
    path: Array,
    facets: Sequence[int] = (),
    *,
    starts: Array = NO_STARTS,
    full: bool = True,
    time_limit: float = 20.0,
    budget: Budget = UNLIMITED,
) -> GraspReport:
    """Decide whether fingers along straight lines between knots (K, N, 2) [m] bring all of Q0 to the goal.

    facets: the one that each finger claims to touch in the end; starts (M, 2) [m]: polygon of translations from the goal, at
    its orientation, that are claimed to be in Q0; empty: no claim.  full: report on all parts although one
    has failed.  time_limit [s]: processor time for what can be reached.  budget: for all parts.
    Raises InvalidProblem for a path that does not fit the problem.
    """
    knots = readonly(path, (len(problem.half_ranges), problem.count, 2), "fingers.path")
    check = _Check(problem, FingerPath(problem.shape, problem.pose, knots), tuple(facets), starts, budget)
    return check.run(full, time_limit)


class _Check:
    """The parts of one verification, the cheap ones first, and what they have found so far."""

    def __init__(
        self,
        problem: GraspProblem,
        path: FingerPath,
        facets: tuple[int, ...],
        starts: Array,
        budget: Budget,
    ) -> None:
        self.problem, self.path, self.facets, self.starts = problem, path, facets, starts
        self.budget = budget
        self.refuted: list[str] = []
        self.doubts: list[str] = []
        self.spent: dict[str, float] = {}
        self.end: EndGrasp | None = None
        self.start: StartSet | None = None
        self.cages: Cages | None = None
        self.dead_ends: DeadEnds | None = None
        self.isolation = NOT_ISOLATED

    def run(self, full: bool, time_limit: float) -> GraspReport:
        """All parts; unless `full`, only up to the first that fails."""
        jams = partial(self.check_dead_ends, time_limit)
        steps: dict[str, Callable[[], None]] = {
            "path": self.check_path,
            "end": self.check_end,
            "knots": self.check_knots,
            "start": self.check_start,
            "dead_ends": jams,
        }
        for name, step in steps.items():
            part = Budget(np.inf)
            try:
                step()
            except OutOfTime:
                self.doubts.append("the time limit was reached")
            self.spent[name] = part.spent
            if (self.refuted or self.doubts) and (name == "path" or not full):
                break
        verdict: Verdict = "refuted" if self.refuted else "unknown" if self.doubts else "certified"
        reason = "; ".join(self.refuted or self.doubts)
        return GraspReport(
            verdict=verdict, reason=reason, cages=self.cages, dead_ends=self.dead_ends, end=self.end,
            start=self.start, seconds=sum(self.spent.values()), spent=self.spent,
        )  # fmt: skip

    def check_path(self) -> None:
        """Grippers can do it, and no finger enters the object that rests at the goal."""
        for k, fingers in enumerate(self.path.knots_w):
            if fault := gripper_fault(self.problem, fingers):
                self.refuted.append(f"knot {k}: {fault}")
        depth = self.path.deepest(np.zeros((1, 3)), 0.0, self.path.last)[0] * self.path.frame.radius
        if depth > START_TOLERANCE * self.problem.shape.size:
            self.refuted.append(f"a finger enters the object at its goal by {depth:.2g} m")

    def check_end(self) -> None:
        """Form closure of the contacts at the last knot."""
        fingers, facets = self.path.knots[-1], self.path.facets
        contacts = touching(facets, fingers)
        for finger, facet in enumerate(self.facets):
            if (finger, facet) not in contacts:
                self.refuted.append(f"finger {finger} does not end on facet {facet}")
        order = form_closure(facets, fingers, contacts)
        self.isolation = isolation(facets, self.path.vertices, fingers, contacts)
        self.end = EndGrasp(
            contacts=tuple(contacts),
            form_closure=order,
            observability_rank=observability_rank(gap_gradients(facets, fingers, contacts)),
            extent=(self.isolation.shift * self.path.frame.radius, self.isolation.turn),
        )
        if order == 0:
            self.refuted.append("the contacts at the end are not in form closure")

    def check_knots(self) -> None:
        """Nested cages at the knots."""
        ranges = np.full((len(self.path.knots), 2), np.nan)
        for k in range(len(ranges)):
            half = float(self.problem.half_ranges[k])
            report = verify_cage(
                self.path.arrangement(k),
                range_resolution=KNOT_RESOLUTION,
                finest=KNOT_RESOLUTION / 2,
                within=(-half, half),
                time_limit=self.budget.left,
            )
            if report.rotation_range is not None:
                ranges[k] = np.array(report.rotation_range) - self.problem.pose[2]
            elif report.verdict == "escapes":
                self.refuted.append(f"the object can escape at knot {k}")
        self.cages = Cages(half_ranges=self.problem.half_ranges, knot_ranges=ranges)
        if not self.cages.nested and not self.refuted:
            wide = np.flatnonzero(~(np.abs(ranges).max(axis=1) <= self.problem.half_ranges + 1e-9))
            self.doubts.append(f"orientations beyond the half-range may be reached at knots {wide.tolist()}")

    def check_start(self) -> None:
        """Q0, and that the starts claimed are in it."""
        self.start = StartSet(self.path, self.budget)
        if len(self.starts) < 3:
            return
        free, known = self.start.holds(self.starts)
        if not free:
            self.refuted.append("starts are claimed at which a finger is inside the object")
        elif not known:
            self.doubts.append("starts are claimed that are not shown to be in Q0")

    def check_dead_ends(self, time_limit: float) -> None:
        """What can be reached from Q0 stays bounded, meets no dead end, and is the goal alone in the end."""
        try:
            events = dead_end_events(self.path, self.budget)
        except SolverFailed as error:
            self.doubts.append(str(error))
            return
        budget = self.budget.part(time_limit)
        tube, pockets = Tube(leak=(0.0, 0.0)), self._pockets(events)
        for coarsest in (COARSEST >> (2 * k) for k in range(ROUNDS)):
            finer = self._tube(coarsest, budget, pockets)
            if tube.closed and not finer.closed:
                break  # no time: the coarse answer stands
            tube = finer
            jams = [self._dead_end(e) for e in events if tube.meets(e.s, e.first, e.last)]
            alone = tube.closed and self._alone(tube)
            sure = any(jam.witness is not None for jam in jams)
            if sure or (alone and not jams) or budget.over:
                break
        self._record(tube, jams, len(events), alone)
        self._conclude(tube, jams, alone)

    def _pockets(self, events: list[DeadEndEvent]) -> Pockets:
        """Of those dead ends that are at orientations which are reached."""
        widest = self.problem.half_ranges[0] + TIGHT
        return Pockets.before(
            self.path, [event for event in events if abs(wrapped(event.first[2])) <= widest]
        )

    def _tube(self, coarsest: int, budget: Budget, pockets: Pockets) -> Tube:
        """What can be reached, with cells of at most this width.

        Mostly it stays within the half-ranges all the way, and out of the pockets of dead ends, which is the easier to show
        the tighter the ranges are.  What jams does neither; then the first range bounds everything.
        """
        half_ranges = self.problem.half_ranges[:-1]
        tube = reach_tube(self.path, half_ranges + TIGHT, coarsest, budget, pockets)
        if not tube.closed and not budget.over:
            limits = np.full(len(half_ranges), half_ranges[0] + WIDE)
            tube = reach_tube(self.path, limits, coarsest, budget)
        return tube

    def _record(self, tube: Tube, jams: list[DeadEnd], listed: int, alone: bool) -> None:
        unknown = np.full((len(self.path.knots), 2), np.nan)
        self.cages = replace(
            self.cages or Cages(half_ranges=self.problem.half_ranges, knot_ranges=unknown),
            samples=np.array([(slab.low, slab.high) for slab in tube.slabs]).reshape(-1, 2),
            ranges=np.array([slab.range for slab in tube.slabs]).reshape(-1, 2),
            leak=tube.leak,
        )
        self.dead_ends = DeadEnds(
            verdict="no_jam" if tube.closed and not jams else "may_jam", events=tuple(jams), listed=listed
        )
        if self.end is not None:
            self.end = replace(self.end, alone=alone)

    def _conclude(self, tube: Tube, jams: list[DeadEnd], alone: bool) -> None:
        """State what is refuted or in doubt."""
        if tube.leak is not None:
            low, high = tube.leak
            report = verify_cage(self.path.arrangement(0.5 * (low + high)), time_limit=self.budget.left)
            if report.verdict == "escapes":
                self.refuted.append(f"the object can escape at s = {0.5 * (low + high):.6g}")
            else:
                self.doubts.append(f"what can be reached may be unbounded for s in [{low:.6g}, {high:.6g}]")
        if any(jam.witness is not None for jam in jams):
            self.refuted.append("a start in Q0 jams")
        elif jams:
            self.doubts.append(f"a dead end at s = {jams[0].s:.6g} is not shown to be out of reach")
        elif tube.leak is None and not alone:
            self.doubts.append("something else than the goal may be left at the end")

    def _alone(self, tube: Tube) -> bool:
        """Whether the contacts exclude everything but the goal among what can be reached at the end."""
        end, before = self.path.last, tube.slabs[-1]
        for ring in (before.ring, uniform_ring(FINEST)):
            last = settled_slab(
                self.path, end, end, ring, before.reached, self.isolation.angle, budget=self.budget
            )
            if last is not None and self.isolation.holds_in(last.shift, *last.range):
                return True
        return False

    def _dead_end(self, event: DeadEndEvent) -> DeadEnd:
        places = event.inner_configurations(9)
        poses = self.path.frame.world_pose(places)
        untouched = self.path.deepest(places, 0.0, event.s) <= TOUCH
        known = self.start.contains(poses) if self.start else np.zeros(len(poses), bool)
        sure = np.flatnonzero(untouched & known & event.strict)
        pose = poses[sure[0]] if len(sure) else poses[len(poses) // 2]
        return DeadEnd(s=event.s, pose=pose, contacts=event.contacts, witness=pose if len(sure) else None)
