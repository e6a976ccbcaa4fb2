"""Search for certified grasps: every method's answers are checked here again, and asked-for limits are kept."""

import itertools

import numpy as np
import pytest
import shapely

from expert.budget import Budget
from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_area, signed_distance
from expert.geometry.pose import Array, rotation, to_body
from expert.grasping import proposals
from expert.grasping.cell import GoalCell
from expert.grasping.decomposed import fillings, smooth_path, topologies
from expert.grasping.goal_cell import can_end
from expert.grasping.gripper import placements
from expert.grasping.nested import FacetGeometry, schedule, shut
from expert.grasping.proposals import RelativeProblem, decomposed, goal_cells
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.check import verify_grasp
from expert.world.fingers import Gripper
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import irregular_polygon

FOREVER = 1e9


def quadrangle(seed: int) -> Shape:
    return Shape(vertices=irregular_polygon(np.random.default_rng(seed), 4))


def problem(shape: Shape, degrees: float = 15.0, **changes: object) -> GraspProblem:
    first = np.array([degrees, 0.75 * degrees, 0.5 * degrees, 0.25 * degrees, 0.5])
    return GraspProblem(shape=shape, pose=np.array([0.1, 0.2, 0.5]), half_ranges=np.radians(first), **changes)  # type: ignore[arg-type]


def area_share(task: GraspProblem, answer: GraspSolution) -> float:
    return abs(signed_area(answer.starts)) / signed_area(task.shape.vertices)


def assert_certified(task: GraspProblem, answer: GraspSolution) -> None:
    report = verify_grasp(task, answer.path, answer.facets)
    assert answer.status == "certified"
    assert report.verdict == "certified"
    assert report.dead_ends.verdict == "no_jam"


@pytest.mark.parametrize("method", ["goal_cell", "decomposed", "miqp1", "miqp2"])
def test_each_method_finds_a_grasp_that_the_checker_confirms(method: str) -> None:
    task = problem(quadrangle(0))
    answer = solve(task, method=method, time_limit=FOREVER)  # type: ignore[arg-type]
    assert answer.method == method
    assert_certified(task, answer)


def test_promised_starts_are_free_and_as_large_as_the_checker_finds() -> None:
    task = problem(Shape(vertices=named_shape("T")))
    answer = solve(task, time_limit=FOREVER)
    report = verify_grasp(task, answer.path, answer.facets)
    assert report.start.area == pytest.approx(shapely.Polygon(answer.starts).area, rel=1e-3)
    assert answer.objective == pytest.approx(shapely.Polygon(answer.starts).area)
    assert area_share(task, answer) > 0.025
    inner = 0.999 * (answer.starts - answer.starts.mean(axis=0)) + answer.starts.mean(axis=0)
    for shift in inner:
        pose = task.pose + np.append(shift, 0.0)
        assert (signed_distance(task.shape.vertices, to_body(pose, answer.path[0])) > 0).all()


def test_a_wide_range_needs_cages_that_are_no_goal_cells() -> None:
    task = problem(Shape(vertices=irregular_polygon(np.random.default_rng(3), 4)), 30.0)
    answer = solve(task, time_limit=FOREVER)
    assert answer.method == "decomposed"
    assert_certified(task, answer)


def test_the_thesis_conditions_alone_admit_a_grasp_that_jams() -> None:
    task = problem(Shape(vertices=irregular_polygon(np.random.default_rng(8), 6)), 30.0)
    search = RelativeProblem(task, Budget(FOREVER))
    verdicts: set[str] = set()
    for proposal in itertools.islice(decomposed(search), 12):
        path = search.frame.world(proposal.path)
        verdicts.add(verify_grasp(task, path, proposal.facets, full=False, time_limit=4.0).verdict)
        if verdicts >= {"refuted", "certified"}:
            break
    assert verdicts >= {"refuted", "certified"}


def test_a_wish_for_large_starts_enlarges_them() -> None:
    task = problem(quadrangle(0))
    first, second, cell = (
        area_share(task, solve(task, method=m, time_limit=FOREVER))  # type: ignore[arg-type]
        for m in ("miqp1", "miqp2", "goal_cell")
    )
    assert first < second < cell


def test_smooth_paths_have_small_starts() -> None:
    shape = quadrangle(9)
    large, smooth = (
        solve(problem(shape, cost=cost), time_limit=FOREVER) for cost in ("attraction", "acceleration")
    )
    assert smooth.objective <= (np.diff(large.path, 2, axis=0) ** 2).sum()
    assert area_share(problem(shape), smooth) < area_share(problem(shape), large)
    assert_certified(problem(shape), smooth)


def test_the_goal_may_be_anywhere() -> None:
    shape = quadrangle(6)
    task = problem(shape)
    moved = GraspProblem(shape=shape, pose=np.array([-3.0, 7.0, 2.0]), half_ranges=task.half_ranges)
    here, there = (solve(t, time_limit=FOREVER) for t in (task, moved))
    assert there.facets == here.facets
    assert to_body(moved.pose, there.path) == pytest.approx(to_body(task.pose, here.path), abs=1e-8)


def test_nested_cages_overlap_all_the_way_and_are_shut_at_their_limits() -> None:
    shape = quadrangle(3)
    frame = Frame.of(shape, np.zeros(3))
    ranges = np.radians([30, 22.5, 15, 7.5, 0.5])
    geometry = FacetGeometry(frame.body(shape.vertices), 0.002)
    knots = schedule(ranges, 0.002)
    grasp = GoalCell(geometry.table, (1, 2, 3, 0), 1, 0, 0.002)
    found = list(topologies(geometry, grasp, knots, Budget(5.0)))
    assert found
    path = smooth_path(geometry, found[0], knots, 0.98)
    assert path is not None
    for s in np.linspace(0, len(path) - 1 - 1e-9, 25):
        k = int(s)
        fingers = path[k] + (s - k) * (path[k + 1] - path[k])
        for angle in np.linspace(-ranges[k], ranges[k], 9):
            obstacles = shapely.polygons(fingers[:, None] - geometry.vertices @ rotation(angle).T)
            assert (shapely.area(shapely.intersection(obstacles, np.roll(obstacles, -1))) > 0).all()
            if abs(angle) == ranges[k]:
                assert shapely.union_all(obstacles).interiors == [] or not _hole_near_goal(obstacles)


def _hole_near_goal(obstacles: Array) -> bool:
    union = shapely.union_all(obstacles)
    return any(shapely.Polygon(hole).distance(shapely.Point(0, 0)) < 0.3 for hole in union.interiors)


def test_ranges_that_must_be_shut_cover_everything_between_arrival_and_departure() -> None:
    limits = np.radians([30, 20, 9, 4, 0.5])
    for knot, limit, reach in zip(schedule(limits, 0.001), limits, limits[[0, 0, 1, 2, 3]], strict=True):
        parts = knot.above
        assert parts[0][0] == limit
        assert parts[-1][1] == pytest.approx(reach)
        assert [(-high, -low) for low, high in parts] == list(knot.below)
        assert all(high == low for (_, high), (low, _) in itertools.pairwise(parts))
        assert all(high - low <= np.radians(4) + 1e-12 and high <= 2 * low + 1e-12 for low, high in parts)
    assert shut(0.1, 0.1) == [(0.1, 0.1)]


def test_the_filling_that_the_rays_name_is_the_one_that_works() -> None:
    shape = quadrangle(3)
    geometry = FacetGeometry(Frame.of(shape, np.zeros(3)).body(shape.vertices), 0.002)
    assert fillings(GoalCell(geometry.table, (1, 2, 3, 0), 1, 0, 0.002)) == [(0, 1)]
    assert fillings(GoalCell(geometry.table, (1, 2, 3, 0), 0, 1, 0.002)) == [(1, 0)]


@pytest.mark.parametrize("parallel", [True, False])
def test_a_gripper_holds_its_fingers_at_every_knot(parallel: bool) -> None:
    gripper = Gripper(fingers=(0, 1), opening=(0.01, 0.09))
    task = problem(quadrangle(0), grippers=(gripper,), parallel=parallel)
    answer = solve(task, time_limit=FOREVER)
    assert_certified(task, answer)
    step = answer.path[:, 1] - answer.path[:, 0]
    opening = np.linalg.norm(step, axis=1)
    assert opening.min() >= 0.01 - 1e-9
    assert opening.max() <= 0.09 + 1e-9
    assert not parallel or np.abs(step[:, 1]).max() < 1e-9


def test_grippers_tell_fingers_apart_only_as_far_as_they_must() -> None:
    shape = quadrangle(0)
    one, two = Gripper(fingers=(0, 1), opening=(0.0, 0.1)), Gripper(fingers=(2, 3), opening=(0.0, 0.2))
    count = {
        n: len(placements(problem(shape, grippers=held, parallel=parallel)))
        for n, held, parallel in (
            (0, (), False),
            (1, (one,), False),
            (2, (one,), True),
            (3, (one, two), False),
            (4, (one, two), True),
        )
    }
    assert count == {0: 1, 1: 6, 2: 12, 3: 6, 4: 24}


def test_what_grippers_do_to_a_cell_is_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    gripper = Gripper(fingers=(0, 1), opening=(0.01, 0.09))
    task = RelativeProblem(problem(quadrangle(0), grippers=(gripper,)), Budget(FOREVER))
    calls: list[GoalCell] = []

    def counted(cell: GoalCell) -> bool:
        calls.append(cell)
        return can_end(cell)

    monkeypatch.setattr(proposals, "can_end", counted)
    first = list(itertools.islice(task.cells(), 3))
    until_then = len(calls)
    all_of_them = list(task.cells())
    assert until_then < len(calls)
    again = list(task.cells())
    assert again[:3] == all_of_them[:3] == first
    assert len(again) == len(all_of_them) > 3
    assert len(calls) == len(task._ranked) * len(placements(task.problem))


def test_three_fingers_hold_to_second_order() -> None:
    task = problem(quadrangle(9), count=3)
    search = RelativeProblem(task, Budget(FOREVER))
    proposal = next(goal_cells(search))
    assert proposal.path.shape == (5, 3, 2)
    report = verify_grasp(task, search.frame.world(proposal.path), proposal.facets, full=False)
    assert report.end.form_closure == 2


def test_nothing_found_is_said_to_be_no_proof() -> None:
    wide = Gripper(fingers=(0, 1), opening=(10.0, 11.0))
    answer = solve(problem(quadrangle(0), grippers=(wide,)), time_limit=FOREVER)
    assert answer.status == "none_found"
    assert "others may exist" in answer.reason
    assert not answer.found


def test_without_time_there_is_no_claim() -> None:
    answer = solve(problem(quadrangle(0)), time_limit=1e-9)
    assert answer.status == "time_limit"


def test_bad_input_is_refused_in_one_line() -> None:
    task = problem(quadrangle(0), grippers=(Gripper(fingers=(0, 1), opening=(0.0, 0.1)),))
    for message, action in (
        ("method: expected goal_cell", lambda: solve(task, method="best")),  # type: ignore[arg-type]
        ("method: expected a problem without grippers", lambda: solve(task, method="miqp1")),
        ("fingers.count: expected 3 or 4", lambda: problem(quadrangle(0), count=5)),
        ("options.half_ranges", lambda: problem(quadrangle(0), 100.0)),
    ):
        with pytest.raises(InvalidProblem, match=message) as caught:
            action()
        assert "\n" not in str(caught.value)
