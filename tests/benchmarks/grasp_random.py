"""The checker of grasps on random finger paths and random grasps: what it predicts against what happens.

    python -m tests.benchmarks.grasp_random [--quick] [--only PART ...] [--json FILE]

Parts and bars:
dead_ends      every stall on 300 uncertified random paths is a predicted dead end, and every object that waits at a strict
               one, untouched, stalls there
nested_cages   40 random paths that meet the thesis's conditions: none that is certified jams; some jam all the same, and
               so does every witness start by which the checker refutes one
unchecked      answers of MIQP2 for half-ranges of 45 deg, which no checker has filtered: the same
observability  sensor rank 3 exactly where first-order form closure holds, 1,000 random grasps
"""

import itertools
import sys
from collections.abc import Iterator

import numpy as np
from scipy.optimize import linprog

from expert.budget import Budget
from expert.geometry.pose import Array
from expert.grasping.proposals import RelativeProblem, thesis
from expert.grasping.sweeping import sweep
from expert.problems.grasp import GraspProblem
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.dead_ends import DeadEndEvent, dead_end_events
from expert.verify.grasp.end_grasp import form_closure, gap_gradients, observability_rank, touching
from expert.verify.grasp.event_kernel import TOUCH
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.report import GraspReport
from expert.verify.grasp.start_set import StartSet
from expert.world.shape import Shape
from tests.benchmarks._grasp_study import TIME_LIMIT, Bars, Part, Row, Study, arrivals, run, task, watched
from tests.support.experiments import closing_path, miss
from tests.support.grasps import shrinking_case
from tests.support.polygons import irregular_polygon

MATCH = 1e-3
"""Largest distance of a stall from its prediction: in s, in enclosing radii and in rad."""
CHECK = 5.0
"""Processor time [s] for what can be reached from one set of starts."""


def dead_ends(study: Study) -> tuple[list[Row], Bars]:
    """Stalls of executions against predictions, and predictions against executions that wait there."""
    paths = 30 if study.quick else 300
    row = {"paths": paths, "stalls": 0, "predicted": 0, "waiting": 0, "stalled": 0}
    for seed in watched(range(paths), "dead ends"):
        shape, path, starts = closing_path(seed)
        fingers = FingerPath(shape, np.zeros(3), path)
        events = dead_end_events(fingers)
        run_ = sweep(shape, path, starts)
        stalled = np.flatnonzero(np.isfinite(run_.stalled))
        for i, place in zip(stalled, fingers.configurations(run_.ends[stalled]), strict=True):
            row["stalls"] += 1
            row["predicted"] += (
                min((miss(e, run_.stalled[i], place) for e in events), default=np.inf) <= MATCH
            )
        waits = [e for e in events if e.strict and _untouched(fingers, e)]
        row["waiting"] += len(waits)
        row["stalled"] += sum(_stalls(fingers, e) for e in waits)
    return [row], {
        "every stall is predicted": 0 < row["stalls"] == row["predicted"],
        "every object that waits at a strict dead end stalls": 0 < row["waiting"] == row["stalled"],
    }


def _untouched(path: FingerPath, event: DeadEndEvent) -> bool:
    """Whether an object at the middle of its slide has seen no finger before."""
    return bool(path.deepest(event.inner_configurations(1), 0.0, event.s)[0] <= TOUCH)


def _stalls(path: FingerPath, event: DeadEndEvent) -> bool:
    start = path.frame.world_pose(event.inner_configurations(1))
    return bool(abs(sweep(path.shape, path.knots_w, start).stalled[0] - event.s) <= MATCH)


def nested_cages(study: Study) -> tuple[list[Row], Bars]:
    """Random paths that meet the thesis's conditions: what the checker says, and what executions do."""
    wanted, row = 4 if study.quick else 40, _tally()
    for problem, path, report in watched(itertools.islice(_nested(), wanted), "nested cages", wanted):
        _judge(problem, path, report, row)
    return [row], _tally_bars([row])


def unchecked(study: Study) -> tuple[list[Row], Bars]:
    """Answers of the thesis's model, whose cages are nested as well: what the checker says, and what executions do."""
    rows = []
    for name in watched(["polygon 1"] if study.quick else list(study.random)[:4], "unchecked"):
        problem, row = task(study.objects[name], 45.0), _tally()
        search = RelativeProblem(problem, Budget(TIME_LIMIT))
        for proposal in itertools.islice(thesis(search, "miqp2"), 1 if study.quick else 5):
            path = search.frame.world(proposal.path)
            _judge(problem, path, verify_grasp(problem, path, full=False, time_limit=CHECK), row)
        rows.append({"object": name} | row)
    return rows, _tally_bars(rows)


def _tally() -> Row:
    verdicts = ("certified", "refuted", "unknown")
    row: Row = {"paths": 0} | dict.fromkeys(verdicts, 0) | {f"{verdict}_that_jam": 0 for verdict in verdicts}
    return row | {"witnesses": 0, "witnesses_that_jam": 0, "worst_share_of_starts": 0.0}


def _tally_bars(rows: list[Row]) -> Bars:
    return {
        "no certified path jams": all(row["certified_that_jam"] == 0 for row in rows),
        "some nested cages jam": any(row["refuted_that_jam"] > 0 for row in rows),
        "every witness jams": all(row["witnesses"] == row["witnesses_that_jam"] for row in rows),
    }


def _nested() -> Iterator[tuple[GraspProblem, Array, GraspReport]]:
    """Random paths that meet the thesis's conditions, and the checker's report on each."""
    for problem, path in map(shrinking_case, itertools.count()):
        fingers = FingerPath(problem.shape, problem.pose, path)
        entered = fingers.deepest(np.zeros((1, 3)), 0.0, fingers.last)[0] > 1e-9
        if entered or not StartSet(fingers).bounded:
            continue
        report = verify_grasp(problem, path, full=False, time_limit=CHECK)
        nested = report.cages is not None and report.cages.nested
        if nested and report.end is not None and report.end.form_closure == 1:
            yield problem, path, report


def _judge(problem: GraspProblem, path: Array, report: GraspReport, row: Row) -> None:
    """Add one path to a tally."""
    row["paths"] += 1
    starts = StartSet(FingerPath(problem.shape, problem.pose, path)).starts(np.random.default_rng(0), 200)
    share = float(1 - arrivals(problem, path, starts).arrived.mean())
    row[report.verdict] += 1
    row[f"{report.verdict}_that_jam"] += share > 0
    row["worst_share_of_starts"] = max(row["worst_share_of_starts"], share)
    witness = report.dead_ends.witness if report.dead_ends else None
    if witness is not None:
        row["witnesses"] += 1
        alone = sweep(problem.shape, path, witness[None], goal=problem.pose)
        row["witnesses_that_jam"] += bool(np.isfinite(alone.stalled[0]))


def observability(study: Study) -> tuple[list[Row], Bars]:
    """Rank of the sensor model against first-order form closure, on random grasps (Remark 4).

    Closure is decided here by weights > 0 that balance; the checker claims it with a margin, so some weak ones it does not.
    """
    count = 100 if study.quick else 1000
    row = {"grasps": count, "form_closed": 0, "agree": 0, "claimed": 0, "claimed_wrongly": 0}
    for seed in watched(range(count), "observability"):
        path = random_grasp(np.random.default_rng(seed))
        contacts = touching(path.facets, path.knots[-1])
        gradients = gap_gradients(path.facets, path.knots[-1], contacts)
        closed = balances(gradients)
        claimed = form_closure(path.facets, path.knots[-1], contacts) == 1
        row["form_closed"] += closed
        row["agree"] += closed == (observability_rank(gradients) == 3)
        row["claimed"] += claimed
        row["claimed_wrongly"] += claimed and not closed
    return [row], {
        "sensor rank 3 exactly where form closure holds": row["agree"] == count,
        "both kinds among the grasps": 0 < row["form_closed"] < count,
        "no form closure is claimed wrongly": row["claimed_wrongly"] == 0,
    }


def random_grasp(rng: np.random.Generator) -> FingerPath:
    """Three to six fingers at rest on random places of a random polygon."""
    vertices = irregular_polygon(rng, int(rng.integers(4, 9)))
    facet = rng.integers(len(vertices), size=int(rng.integers(3, 7)))
    share = rng.uniform(0.1, 0.9, (len(facet), 1))
    points = (1 - share) * vertices[facet] + share * np.roll(vertices, -1, axis=0)[facet]
    return FingerPath(Shape(vertices=vertices), np.zeros(3), np.stack([points, points]))


def balances(gradients: Array) -> bool:
    """First-order form closure: the gradients (C, 3) span, and some weights > 0 make their sum vanish."""
    count = len(gradients)
    if np.linalg.matrix_rank(gradients, tol=1e-9) < 3:
        return False
    rows = np.vstack([np.column_stack([gradients.T, np.zeros(3)]), [*np.ones(count), 0.0]])
    least = np.column_stack([-np.eye(count), np.ones(count)])  # t <= every weight
    answer = linprog([*np.zeros(count), -1.0], least, np.zeros(count), rows, [0, 0, 0, 1])
    return bool(answer.status == 0 and -answer.fun > 1e-9)


PARTS: dict[str, Part] = {
    "dead_ends": dead_ends,
    "nested_cages": nested_cages,
    "unchecked": unchecked,
    "observability": observability,
}

if __name__ == "__main__":
    sys.exit(run(PARTS, __doc__))
