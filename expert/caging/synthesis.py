"""Find fingers that cage an object: solve the model over a ladder of rotation ranges, verify, cut off what is refuted.

No answer leaves unverified.  Cages around immobilising grasps are tried after the first rung of the ladder, or first of
all where walls, fixed fingers, grippers or a cost take part.
"""

import itertools
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace

import numpy as np

from expert.budget import Budget
from expert.caging.closures import Closures, directions
from expert.caging.immobilise import candidates
from expert.caging.model import SweptModel
from expert.caging.polish import STEPS, improvements
from expert.caging.requirements import require
from expert.caging.rings import break_symmetry, hubs, labelled, rings
from expert.caging.tally import Tally
from expert.caging.thesis import ThesisModel, slices
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.loops.swept import SweptGeometry
from expert.problems.cage import (
    Arrangement,
    CageMethod,
    CageOptions,
    CageProblem,
    CageSolution,
    CageSolver,
    CageStatus,
)
from expert.verify.cage.check import verify_cage
from expert.world.frame import Frame

LADDER = tuple((np.radians(a), np.radians(b)) for a, b in (
    (15, 15), (20, 20), (30, 30), (10, 10), (5, 5), (45, 45), (7, 7),
    (5, 25), (25, 5), (10, 40), (40, 10), (3, 3), (60, 60),
))  # fmt: skip
TIGHT = np.radians(20)
"""Restricted fingers leave less room: the ladder begins with ranges of about this width."""
WIDE = np.radians(75)
"""Far apart or close together, free fingers hold an object loosely: with a cost the ladder begins with such ranges."""
THESIS_LADDER = ((np.radians(40), np.radians(40)), (np.radians(90), np.radians(90)))
THESIS_SLICES, THESIS_FACETS = 9, 16
"""Slices of MIP1, as many as in Thesis 5.1.7, and the most facets: limit contacts (5-CT8) are as many as their triples."""
QUICK = 3
"""Ranges of the ladder that the quick part tries."""
KNOWN: dict[CageStatus, str] = {
    "caged": "caged",
    "none_found": "no cage of the kind searched for",
    "time_limit": "undecided in their share of the time",
}
"""What a search for some number of fingers says.  None of it is a proof that they cannot cage the object."""
MOST_PIECES = 24
"""Of the cover, in any model."""
MOST_CUTS = 5
"""Refuted answers per model after which the next one is tried."""


@dataclass(frozen=True)
class Attempt:
    """One model to solve: half-ranges [rad], size of the cover, entry and exit piece alike, time [s]."""

    below: float
    above: float
    most_pieces: int
    one_piece: bool
    seconds: float


def solve(
    problem: CageProblem | Arrangement,
    *,
    time_limit: float = CageOptions.time_limit,
    method: CageMethod = CageOptions.method,
    solver: CageSolver = CageOptions.solver,
) -> CageSolution:
    """A verified cage, the best found within time_limit where there is a cost (Thesis 5.1, reformulated).

    time_limit [s] is processor time: what is found does not depend on the machine's load.

    Raises InvalidProblem for an arrangement whose fingers are given: there is nothing to solve; and for a problem that
    MIP1 (method thesis) does not know: walls, fixed fingers, grippers, costs, more than THESIS_FACETS facets.
    """
    if isinstance(problem, Arrangement):
        raise InvalidProblem(
            "fingers.count", expected="fingers to place", got="positions", remedy="verify it"
        )
    if problem.fewest:
        return _fewest(problem, time_limit, method, solver)
    tally = Tally(problem, Budget(time_limit))
    if method == "thesis":
        _search_slices(tally, solver)
    else:
        _search_ranges(tally, method, solver)
    return tally.answer()


def _fewest(problem: CageProblem, time_limit: float, method: CageMethod, solver: CageSolver) -> CageSolution:
    """The first count of fingers, from the least, for which a cage is found; each has an equal share of the time left."""
    budget = Budget(time_limit)
    answers: dict[int, CageSolution] = {}
    for count in range(max(0, 2 - len(problem.fixed)), problem.count + 1):
        answers[count] = answer = solve(
            replace(problem, count=count, fewest=False),
            time_limit=budget.left / (problem.count + 1 - count),
            method=method,
            solver=solver,
        )
        if answer.found:
            break
    undecided = any(other.status == "time_limit" for other in answers.values())
    return replace(
        answer,
        status="time_limit" if undecided and not answer.found else answer.status,
        reason="; ".join(f"{n} fingers: {KNOWN[other.status]}" for n, other in answers.items()),
        seconds=budget.spent,
        attempts=sum(other.attempts for other in answers.values()),
        refuted=sum(other.refuted for other in answers.values()),
        unconfirmed=sum(other.unconfirmed for other in answers.values()),
    )


def _search_slices(tally: Tally, solver: CageSolver) -> None:
    """MIP1 for one choice of slices after the other."""
    problem = tally.problem
    if len(problem.fixed) or len(problem.walls) or problem.grippers or problem.cost != "none":
        extras = "fixed fingers, walls, grippers or a cost"
        raise InvalidProblem("options.method", expected="swept where the problem has " + extras, got="thesis")
    facets = len(problem.shape.vertices)
    if facets > THESIS_FACETS:
        most = f"swept for more than {THESIS_FACETS} facets"
        raise InvalidProblem("options.method", expected=most, got=f"thesis for {facets}")
    frame = Frame.of(problem.shape, problem.pose)
    for below, above in problem.rotation or THESIS_LADDER:
        if tally.budget.over or tally.best.found:
            return
        angles = slices(below, above, THESIS_SLICES)
        model = ThesisModel(
            frame.body(problem.shape.vertices),
            problem.margin * problem.shape.size / frame.radius,
            angles,
            problem.count,
        )
        tally.exhausted[below, above] = _search(tally, model, frame, tally.budget.left, solver)


def _search_ranges(tally: Tally, method: CageMethod, solver: CageSolver) -> None:
    """Swept models, and grasps, for one range of rotation after the other."""
    if tally.problem.count == 0:
        _judge_fixed(tally)
        return
    for attempt in _attempts(tally.problem, method):
        if tally.budget.over or tally.done:
            return
        before = tally.best
        if attempt is None:
            _try_grasps(tally)
        else:
            _try_models(tally, attempt, solver)
        if tally.best is not before and not tally.done:
            _polish(tally)


def _judge_fixed(tally: Tally) -> None:
    """Nothing is to be placed: do the fixed fingers cage the object by themselves?"""
    report = tally.judge(np.empty((0, 2)))
    if report is not None and report.verdict == "caged":
        tally.keep(np.empty((0, 2)), report)


def _attempts(problem: CageProblem, method: CageMethod) -> Iterator[Attempt | None]:
    """A quick model, grasps (None), more quick models, then models of growing size and time."""
    plain = problem.cost == "none" and not _restricted(problem)
    if not plain and method != "model":
        yield None
    middle = TIGHT if _restricted(problem) else WIDE
    ranges = problem.rotation or (LADDER if plain else sorted(LADDER, key=lambda r: abs(sum(r) - middle)))
    few = problem.count + len(problem.fixed) == 2 and not len(problem.walls)
    quick = [Attempt(below, above, 3, True, 0.4) for below, above in ranges[:QUICK] if plain and not few]
    yield from quick[:1]
    if plain and method != "model":
        yield None
    yield from quick[1:]
    sizes = (False,) if few or problem.grippers else (True, False)
    slices = (1.0, 4.0, 16.0, 64.0) if plain else (3.0, 10.0, 30.0)
    for seconds, (below, above), one_piece in itertools.product(slices, ranges, sizes):
        yield Attempt(below, above, MOST_PIECES, one_piece, seconds)


def _try_grasps(tally: Tally) -> None:
    """Cages around immobilising grasps that hold even where each finger is off by half the margin."""
    problem = tally.problem
    for fingers in _grasps(problem, np.random.default_rng(0)):
        if tally.budget.over or tally.best.found:
            return
        _try(tally, to_world(problem.pose, fingers), 400)


def _polish(tally: Tally) -> None:
    """Steps of ever smaller size to a lower cost, each to a verified cage."""
    problem, rng = tally.problem, np.random.default_rng(0)
    sizes = [share * problem.shape.size for share in STEPS]
    while sizes and not tally.budget.over:
        before = tally.best
        for fingers in improvements(problem, before.fingers, sizes[0], rng):
            _try(tally, fingers, 150)
            if tally.best is not before or tally.budget.over:
                break
        else:
            sizes.pop(0)


def _try(tally: Tally, fingers: Array, cell_budget: int) -> None:
    """Keep fingers (count, 2) [m] if they cage the object even where each is off by half the margin.

    Undecided within the budget of the verifier is not good enough, and not counted: nothing was claimed.
    """
    problem = tally.problem
    slack = 0.5 * problem.margin * problem.shape.size
    tally.attempts += 1
    try:
        report = verify_cage(
            problem.arrangement(fingers), slack=slack, cell_budget=cell_budget, time_limit=tally.budget.left
        )
    except InvalidProblem:  # inside the object
        return
    if report.verdict == "caged":
        tally.keep(fingers, report)


def _restricted(problem: CageProblem) -> bool:
    return bool(problem.grippers) or bool(len(problem.walls)) or bool(len(problem.fixed))


def _grasps(problem: CageProblem, rng: np.random.Generator) -> Iterator[Array]:
    """Fingers (count, 2) in the body frame, close to where they hold the object."""
    tripod = problem.cost == "max_opening" and problem.count == 3
    if _restricted(problem) or tripod:
        grasps = Closures(problem).candidates(rng)
    else:
        grasps = candidates(problem.shape.vertices, problem.count, problem.shape.size, rng)
    for fingers in grasps:
        alike = problem.cost == "max_opening" and problem.count == 2 and not problem.grippers
        order = np.argsort(to_world(problem.pose, fingers)[:, 0])  # they open along x
        yield fingers[order] if alike else fingers


def _try_models(tally: Tally, attempt: Attempt, solver: CageSolver) -> None:
    """Solve one model for each order of the loop; verify, and cut off what is refuted."""
    problem = tally.problem
    frame = Frame.of(problem.shape, problem.pose)
    clearance = problem.margin * problem.shape.size / frame.radius
    geometry = SweptGeometry(frame.body(problem.shape.vertices), clearance, attempt.most_pieces)
    orders = enumerate(rings(problem, frame))
    for opening, (k, ring) in itertools.product(directions(problem), orders):
        alike = len(ring) == problem.count and not labelled(problem)
        for filling in hubs(len(ring), alike):
            if tally.budget.over or tally.done:
                return
            key = (*astuple(attempt)[:-1], opening, k, filling)
            if tally.exhausted.get(key):
                continue
            model = SweptModel(
                geometry, ring, (-attempt.below, attempt.above), hubs=filling, one_piece=attempt.one_piece
            )
            if not model.feasible or tally.budget.over:
                continue
            break_symmetry(model, problem)
            require(model, problem, frame, solver, opening, tally.best.objective)
            tally.exhausted[key] = _search(tally, model, frame, attempt.seconds, solver)


def _search(
    tally: Tally, model: SweptModel | ThesisModel, frame: Frame, seconds: float, solver: CageSolver
) -> bool:
    """Verify what the model proposes, and cut off what is refuted.  Whether it was proved to have no more to propose."""
    for _ in range(MOST_CUTS):
        tally.attempts += 1
        guess = model.propose(solver, min(seconds, tally.budget.left))
        if guess.fingers is None:
            return guess.status == "infeasible"
        fingers = frame.world(guess.fingers)
        report = tally.judge(fingers)
        if report is not None and report.verdict == "caged":
            tally.keep(fingers, report, guess.meetings)
            return False
        model.cut_off()
    return False
