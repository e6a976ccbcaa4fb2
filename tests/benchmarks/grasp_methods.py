"""Certified grasping: sets of starts by method, sensitivity to what certificates exclude, and force-closure grasps.

    python -m tests.benchmarks.grasp_methods [--quick] [--only PART ...] [--json FILE]

Parts and bars (seconds are processor time of one thread):
methods        starts: MIQP2 >= MIQP1 and goal cell >= MIQP2 in the median
sensitivity    to finger placement and finger friction, contact simulator and MuJoCo: reported, no bar
three_fingers  certified at 15 deg, held to second order: no certificate is refuted after a motion, all starts of
               certified ones arrive; how many there are is reported
force_closure  ends from the same starts by contacts chosen for their quality: reported, no bar
"""

import sys
import time

import numpy as np

from dlm.simulator.grasp import replay_grasp, replay_grasp_in_mujoco
from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array
from expert.grasping.executions import force_closure_comparison, start_set
from expert.grasping.sweeping import sweep
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem, GraspSolution
from tests.benchmarks._grasp_study import (
    TIME_LIMIT,
    Bars,
    Part,
    Row,
    Study,
    arrivals,
    moved_report,
    run,
    task,
    watched,
)

PLACEMENT, FRICTION = (0.0005, 0.001, 0.002, 0.005), (0.0, 0.05, 0.1)
SAME = 1e-4
"""L1 error of an end pose, over the object's size, below which a force-closure grasp counts as arrived."""


def methods(study: Study) -> tuple[list[Row], Bars]:
    """Share of the object's area that the starts take up at the goal's orientation, by method (Fig. 5-30)."""
    names = ["T", "polygon 0"] if study.quick else ["T", "hourglass", *list(study.random)[:3]]
    rows = []
    for name in watched(names, "methods"):
        vertices = study.objects[name]
        whole = mass_properties(vertices).area
        row: Row = {"object": name}
        for method in ("miqp1", "miqp2", "goal_cell"):
            cost = "acceleration" if method == "miqp1" else "attraction"
            problem = task(vertices, cost=cost)
            began = time.process_time()
            answer = solve(problem, method=method, time_limit=TIME_LIMIT)
            row[method] = start_set(problem, answer).area / whole if len(answer.path) else 0.0
            row[f"{method}_status"] = answer.status
            row[f"{method}_seconds"] = time.process_time() - began
        rows.append(row)
    first, second, cell = (np.median([r[m] for r in rows]) for m in ("miqp1", "miqp2", "goal_cell"))
    bars = {"MIQP2 >= MIQP1 in the median": bool(second >= first)}
    if not study.quick:  # two objects have no telling median
        bars["goal cell >= MIQP2 in the median"] = bool(cell >= second)
    return rows, bars


def sensitivity(study: Study) -> tuple[list[Row], Bars]:
    """End poses of certified grasps with misplaced fingers, finger friction, and in other simulators."""
    rows = []
    for name, problem, answer in study.certified():
        starts = start_set(problem, answer)
        chosen = starts.starts(np.random.default_rng(1), 5 if study.quick else 20)
        row: Row = {"object": name}
        for share in PLACEMENT:
            row[f"placement_{100 * share:g}%"] = _misplaced(problem, answer, chosen, share)
        for friction in FRICTION:
            ends = replay_grasp(problem, answer.path, chosen, friction=friction)[:, -1]
            row[f"friction_{friction:g}"] = _spread(problem, ends)
        one = replay_grasp_in_mujoco(problem, answer.path, chosen[0])[-1:]
        row["mujoco"] = _spread(problem, one)
        rows.append(row)
    return rows, {}


def _misplaced(problem: GraspProblem, answer: GraspSolution, starts: Array, share: float) -> Row:
    """Each finger off by a constant vector of that length over the object's size; eight draws."""
    ends = []
    for seed in range(8):
        angles = np.random.default_rng(seed).uniform(0, 2 * np.pi, problem.count)
        offset = share * problem.shape.size * np.column_stack([np.cos(angles), np.sin(angles)])
        for start in starts:
            try:
                ends.append(sweep(problem.shape, answer.path + offset, start[None], goal=problem.pose).ends)
            except InvalidProblem:
                continue  # a finger begins inside: no execution
    return _spread(problem, np.concatenate(ends))


def _spread(problem: GraspProblem, ends: Array) -> Row:
    off = ends - problem.pose
    distance = np.linalg.norm(off[:, :2], axis=1) / problem.shape.size
    angle = np.degrees(np.abs(off[:, 2]))
    return {
        "median_distance": float(np.median(distance)), "worst_distance": float(distance.max()),
        "median_deg": float(np.median(angle)), "worst_deg": float(angle.max()),
    }  # fmt: skip


def force_closure(study: Study) -> tuple[list[Row], Bars]:
    """Where contacts of best quality, approached along their normals, bring the object from the certified starts (Fig. 5-31)."""
    rows = []
    for name, problem, answer in study.certified():
        _, errors, _ = force_closure_comparison(problem, answer, 100)
        row: Row = {"object": name}
        for strategy, missed in errors.items():
            row[f"{strategy}, median error"] = float(np.median(missed))
            row[f"{strategy}, arrived"] = float((missed <= SAME).mean())
        rows.append(row)
    return rows, {}


def three_fingers(study: Study) -> tuple[list[Row], Bars]:
    """Grasps of three fingers, whose contact normals meet in one point at the end."""
    rows = []
    for name in watched(["hourglass", "polygon 0"] if study.quick else study.objects, "three fingers"):
        vertices = study.objects[name]
        problem = task(vertices, count=3)
        began = time.process_time()
        answer = solve(problem, time_limit=TIME_LIMIT)
        row: Row = {"object": name, "status": answer.status, "seconds": time.process_time() - began}
        if len(answer.path):
            row["area"] = start_set(problem, answer).area / mass_properties(vertices).area
            row["verdict"] = moved_report(problem, answer).verdict
            row |= _arrivals(problem, answer, 100 if study.quick else 500)
        rows.append(row | {"reason": answer.reason})
    sure = [row for row in rows if row["status"] == "certified"]
    return rows, {
        "no certificate is refuted after a motion": all(row["verdict"] != "refuted" for row in sure),
        "every certified start arrives": bool(sure) and all(row["arrived"] == 1 for row in sure),
    }


def _arrivals(problem: GraspProblem, answer: GraspSolution, count: int) -> Row:
    starts = start_set(problem, answer)
    runs = arrivals(problem, answer.path, starts.starts(np.random.default_rng(0), count))
    worst = {"worst_distance": runs.worst_distance, "worst_angle_deg": runs.worst_angle}
    return {"arrived": float(runs.arrived.mean()), **worst}


PARTS: dict[str, Part] = {
    "methods": methods,
    "sensitivity": sensitivity,
    "three_fingers": three_fingers,
    "force_closure": force_closure,
}

if __name__ == "__main__":
    sys.exit(run(PARTS, __doc__))
