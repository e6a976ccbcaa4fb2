"""Verdicts on finger paths: certified ones execute, and bad claims are refuted."""

import json

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.grasping.sweeping import sweep
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.check import verify, verify_grasp
from expert.verify.grasp.dead_ends import dead_end_events
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.report import Cages, DeadEnds, EndGrasp, GraspReport
from expert.verify.grasp.start_set import StartSet
from expert.world.fingers import Gripper
from expert.world.shape import Shape
from tests.support.grasps import mirrored, moved, problem_of, shrinking_case, turned
from tests.support.jams import jams

BOX = np.array([[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]])
CONTACTS = np.array([[0.02, -0.03], [0.05, -0.015], [-0.02, 0.03], [-0.05, 0.015]])
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
HALF_RANGES = np.radians([15, 10, 5])
FACETS = (0, 1, 2, 3)

CERTIFIED = (11, 52)


def box_path(*distances: float) -> Array:
    return np.stack([CONTACTS + d * OUTWARD for d in distances])


CLOSING = box_path(0.002, 0.001, 0.0)


def box_problem(**changes: object) -> GraspProblem:
    fields = {"shape": Shape(vertices=BOX), "pose": np.zeros(3), "half_ranges": HALF_RANGES}
    return GraspProblem(**(fields | changes))  # type: ignore[arg-type]


def parts(report: GraspReport) -> tuple[Cages, DeadEnds, EndGrasp, StartSet]:
    """All parts of a report on which nothing was left out."""
    assert report.cages and report.dead_ends and report.end and report.start  # noqa: PT018
    return report.cages, report.dead_ends, report.end, report.start


def test_four_fingers_that_close_on_a_box_are_certified_in_all_parts() -> None:
    report = verify_grasp(box_problem(), CLOSING, FACETS)
    assert report.certified, report.reason
    cages, dead_ends, end, start = parts(report)
    assert cages.held
    assert (np.diff(np.ptp(cages.knot_ranges, axis=1)) < 0).all()
    assert dead_ends.verdict == "no_jam"
    assert (end.form_closure, end.observability_rank, end.alone) == (1, 3, True)
    assert max(end.extent) < 1e-6
    assert start.area == pytest.approx(0.004**2, rel=1e-9)  # each pair of sides has 4 mm of play


@pytest.mark.parametrize("seed", CERTIFIED)
def test_all_starts_of_a_certified_grasp_end_at_the_goal(seed: int) -> None:
    problem, path = shrinking_case(seed)
    report = verify_grasp(problem, path)
    assert report.certified
    start = parts(report)[3]
    starts = start.starts(np.random.default_rng(0), 100)
    assert start.contains(starts).all()
    run = sweep(problem.shape, path, starts)
    distance, angle = run.misses(problem.pose)
    assert np.isnan(run.stalled).all()
    assert distance.max() < 1e-5 * problem.shape.size
    assert angle.max() < np.radians(0.01)


def test_verdicts_survive_motion_mirror_images_and_scaling() -> None:
    pose = np.array([0.4, -1.0, 2.0])
    for (problem, path), verdict in (
        (shrinking_case(CERTIFIED[0]), "certified"),
        (jams()["I, late"], "refuted"),
    ):
        v = problem.shape.vertices
        copies = (
            (problem_of(v, pose), moved(path, pose)),
            (problem_of(turned(v, 0.5), (0, 0, -0.5)), path),
            (problem_of(mirrored(v)[::-1]), mirrored(path)),
            (problem_of(20 * v), 20 * path),
        )
        for copy, knots in copies:
            assert verify_grasp(copy, knots, full=False).verdict == verdict


def test_starts_are_free_and_cover_the_range_of_the_first_cage() -> None:
    report = verify_grasp(box_problem(), CLOSING)
    cages, _, _, start = parts(report)
    starts = start.starts(np.random.default_rng(0), 500)
    path = FingerPath(Shape(vertices=BOX), np.zeros(3), CLOSING)
    assert path.gap(path.configurations(starts), 0.0).min() >= 0
    low, high = cages.knot_ranges[0]
    assert low <= starts[:, 2].min() < 0.6 * low
    assert 0.6 * high < starts[:, 2].max() <= high
    assert not start.contains(np.array([[0.5, 0, 0], [0, 0, 1.0]])).any()


def refusal(problem: GraspProblem, path: Array, facets: tuple[int, ...] = ()) -> str:
    report = verify_grasp(problem, path, facets, full=False)
    assert report.verdict == "refuted"
    return report.reason


def test_an_open_cage_is_refuted() -> None:
    assert "escape at knot 0" in refusal(box_problem(), box_path(0.05, 0.001, 0.0))


def test_a_cage_that_opens_between_knots_is_not_certified() -> None:
    problem = box_problem(half_ranges=np.radians([15, 10, 5, 2.5]))
    path = np.concatenate([CLOSING[:2], CLOSING[1:]])
    path[1:3, 1] = [
        [0.052, -0.0299],
        [0.052, 0.0299],
    ]  # one finger crosses over: all the way it is near the corners
    path[1:3, 0] += [[0.0, -0.03], [0.0, 0.0]]
    report = verify_grasp(problem, path)
    assert not report.certified
    assert report.reason in str(report)


def test_a_finger_that_crosses_the_object_is_refuted() -> None:
    path = CLOSING.copy()
    path[1, 0] = [0.02, 0.01]
    assert "enters the object" in refusal(box_problem(), path)


def test_an_end_without_form_closure_is_refuted() -> None:
    assert "form closure" in refusal(box_problem(), box_path(0.002, 0.001, 0.0005))
    middles = CLOSING * np.abs(OUTWARD)  # no couple against rotation, to first order
    assert parts(verify_grasp(box_problem(), middles, FACETS))[2].form_closure == 2


def test_a_claimed_facet_that_is_not_touched_is_refuted() -> None:
    assert "finger 0 does not end on facet 2" in refusal(box_problem(), CLOSING, (2, 1, 0, 3))


def test_a_gripper_that_cannot_open_so_far_is_refuted() -> None:
    wide = float(np.linalg.norm(CLOSING[0, 0] - CLOSING[0, 2]))
    tight = box_problem(grippers=(Gripper(fingers=(0, 2), opening=(0.0, wide - 1e-3)),))
    assert "gripper 0" in refusal(tight, CLOSING)
    fitting = box_problem(grippers=(Gripper(fingers=(0, 2), opening=(0.0, wide)),))
    assert verify_grasp(fitting, CLOSING, full=False).certified


def test_half_ranges_that_are_exceeded_are_not_certified() -> None:
    report = verify_grasp(box_problem(half_ranges=np.radians([6, 3, 1])), CLOSING)
    assert report.verdict == "unknown"
    assert "knots [0, 1]" in report.reason


def test_a_short_check_stops_at_the_first_failure() -> None:
    report = verify_grasp(box_problem(), box_path(0.05, 0.001, 0.0), full=False)
    assert report.verdict == "refuted"
    assert report.dead_ends is None


def test_paths_that_do_not_fit_the_problem_are_refused() -> None:
    with pytest.raises(InvalidProblem, match=r"fingers\.path"):
        verify_grasp(box_problem(), CLOSING[:2])
    with pytest.raises(InvalidProblem, match="status"):
        verify(box_problem(), GraspSolution(status="none_found"))
    with pytest.raises(InvalidProblem, match="solve it first"):
        verify(box_problem(), None)


def test_the_report_is_plain_json_and_readable() -> None:
    answer = GraspSolution(status="certified", path=CLOSING, facets=FACETS)
    report = verify(box_problem(), answer)
    data = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert data["verdict"] == "certified"
    assert data["end"]["form_closure"] == 1
    assert str(report).splitlines()[0] == "certified: every start in Q0 ends at the goal"


def test_the_goal_itself_is_no_dead_end() -> None:
    path = FingerPath(Shape(vertices=BOX), np.zeros(3), CLOSING)
    assert all(np.abs(e.first).max() > 0.1 for e in dead_end_events(path))
