import itertools
from dataclasses import replace

import numpy as np
import pytest

from expert.geometry.pose import rotation, wrapped
from expert.pushing.goal import Goal, symmetries
from expert.pushing.impulses import ANGLE, X, run
from expert.pushing.planner import PRICES, Effort, Planner, Workspace, box
from expert.pushing.refine import composed, refine, refine_plan
from expert.pushing.search import beam_search, error_after, goals_from
from expert.pushing.table import Grid, again, push_table
from expert.world.shape import Shape
from tests.support.pushing import SQUARE, TEE, square_model, tee_model

ORIGIN = np.array([0.0, 45.0])
COARSE = Grid(stations=8, angles=(-0.4, 0.0, 0.4), lengths=(40.0, 90.0))


@pytest.fixture(scope="module")
def planner():
    model = tee_model()
    goal = Goal(TEE, ORIGIN, np.array([230.0, 290.0, np.pi / 4]))
    space = Workspace(walls=box(8, 503), finger_walls=box(0, 512))
    return Planner(push_table(model, Grid()), model, goal, space)


def test_error_is_the_root_mean_square_displacement_of_the_objects_points():
    goal = Goal(TEE, ORIGIN, np.array([10.0, -5.0, 0.4]))
    pose = np.array([14.0, 3.0, 0.9])
    rng = np.random.default_rng(0)
    cloud = np.concatenate(
        [piece[0] + rng.random((n, 2)) * np.ptp(piece, axis=0) for piece, n in _shares(TEE, 70_000)]
    )
    cloud = cloud - ORIGIN
    moved, wanted = (p[:2] + cloud @ rotation(p[2]).T for p in (pose, goal.pose))
    expected = np.sqrt(((moved - wanted) ** 2).sum(1).mean())
    assert goal.error(pose) == pytest.approx(expected, rel=0.01)


def _shares(shape, count):
    """Rectangles with their share of `count` points, each from its lower left corner."""
    sizes = [np.ptp(piece, axis=0) for piece in shape.pieces]
    areas = np.array([a * b for a, b in sizes])
    pieces = [np.array([piece.min(axis=0), piece.max(axis=0)]) for piece in shape.pieces]
    return zip(pieces, (count * areas / areas.sum()).astype(int), strict=True)


def test_symmetries_of_known_shapes():
    triangle = Shape(vertices=[[np.cos(a), np.sin(a)] for a in 2 * np.pi * np.arange(3) / 3])
    oblong = Shape(vertices=[[0, 0], [2, 0], [2, 1], [0, 1]])
    assert [len(symmetries(s)) for s in (TEE, SQUARE, triangle, oblong)] == [1, 4, 3, 2]


def test_a_quarter_turn_of_a_square_is_no_error():
    goal = Goal(SQUARE, np.zeros(2), np.array([1.0, 2.0, 0.1]))
    assert goal.error(np.array([1.0, 2.0, 0.1 + np.pi / 2])) == pytest.approx(0, abs=1e-12)
    assert goal.error(np.array([1.0, 2.0, 0.2])) > 1


def test_compiled_error_of_a_push_is_the_goals(planner):
    """The error after each push of the table, from a few poses, without rolling anything out."""
    rng = np.random.default_rng(0)
    moves, spread = planner.moves, planner.task.spread
    for pose in rng.uniform([0, 0, -4], [500, 500, 4], (5, 3)):
        goals = goals_from(planner.task, *pose)
        rows = zip(moves.middles, moves.turns, strict=True)
        found = [error_after(goals, spread, *middle, *turn) for middle, turn in rows]
        after = composed(pose[None], planner.table.shifts)
        assert found == pytest.approx(planner.goal.error(after), rel=1e-9)


def test_a_wide_beam_finds_what_brute_force_finds():
    """Two pushes of a coarse table, without walls: least time + price of the rest over all sequences."""
    model = square_model()
    table = push_table(model, COARSE)
    goal = Goal(SQUARE, np.zeros(2), np.array([60.0, 40.0, 0.3]))
    planner = Planner(table, model, goal)
    pose, finger = np.zeros(3), table.ways.stations[0]
    nodes, _ = beam_search(planner.moves, planner.task, PRICES, pose, finger, 2, len(table.steps), 4)
    found = nodes[len(table.steps) :]["score"].min()

    def time(at, k):
        lengths, first = np.empty(8), np.empty(8, np.int64)
        from expert.pushing.roads import distances

        distances(table.ways, *at, lengths, first)
        station = int(np.searchsorted(table.first, k, side="right") - 1)
        return PRICES.travel + lengths[station] / PRICES.pace + table.steps[k]

    best = np.inf
    for i, j in itertools.product(range(len(table.steps)), repeat=2):
        end = composed(composed(pose[None], table.shifts[i : i + 1]), table.shifts[j : j + 1])[0]
        rest = PRICES.miss + PRICES.error * float(goal.error(end))
        best = min(best, time(finger, i) + time(table.fingers[i], j) + rest)
    assert found >= best - 1e-9
    assert found <= best + 3  # the beam keeps one push of each station and node: within a push length


def test_refinement_makes_near_misses_exact(planner):
    """Pushes that miss by some pixels and degrees are brought to the pose that others reach; none becomes worse."""
    rng = np.random.default_rng(0)
    before = np.array([[180.0, 250.0, 0.9]])
    errors = []
    for _ in range(60):
        push = np.array([[rng.uniform(0, 590), rng.uniform(-0.5, 0.5), rng.uniform(40, 110)]])
        aim = Goal(TEE, ORIGIN, composed(before, planner.table.outcomes(push)[0])[0])
        off = push + rng.normal(size=(1, 3)) * [4, 0.05, 4]
        pushes, after, _, (error,) = refine(planner.table, aim, before, off, 8)
        unrefined = aim.error(composed(before, planner.table.outcomes(off)[0]))[0]
        again = composed(before, planner.table.outcomes(pushes)[0])
        assert error <= unrefined
        assert again == pytest.approx(after)
        assert aim.error(after)[0] == pytest.approx(error)
        errors.append([unrefined, error])
    first, last = np.median(errors, axis=0)
    assert first > 2
    assert last < 0.01
    assert np.mean(np.array(errors)[:, 1] < 0.5) > 0.8


def test_the_block_goes_where_the_plan_says(planner):
    """First pushes of plans from random places, carried out by the exact model: the travel moves nothing, the push as told."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        pose = np.array([*rng.uniform(180, 330, 2), rng.uniform(-3, 3)])
        finger = pose[:2] + 180 * np.array([np.cos(a := rng.uniform(0, 6.28)), np.sin(a)])
        plan = planner.plan(pose, finger, np.zeros(2), 1.5)
        state = np.zeros(13)
        state[:2], state[X : ANGLE + 1] = finger, pose
        run(planner.model.law, state, plan.commands[: plan.travel], 10)
        assert state[X : ANGLE + 1] == pytest.approx(pose, abs=1e-12)
        run(planner.model.law, state, plan.commands[plan.travel :], 10)
        assert state[X : ANGLE + 1] == pytest.approx(plan.expected, abs=1e-6)
        if plan.pushes == 1 and plan.reaches:
            assert planner.goal.error(plan.expected) == pytest.approx(plan.error, abs=1e-6)
            assert plan.error <= 1.5


def test_plans_reach_the_goal_in_few_pushes(planner):
    rng = np.random.default_rng(5)
    for _ in range(5):
        pose = np.array([*rng.uniform(180, 330, 2), rng.uniform(-3, 3)])
        finger, velocity, state = np.array([60.0, 60.0]), np.zeros(2), np.zeros(13)
        state[:2], state[X : ANGLE + 1] = finger, pose
        for _ in range(8):
            plan = planner.plan(state[X : ANGLE + 1], state[:2], velocity, 1.5)
            run(planner.model.law, state, plan.commands, 10)
            velocity = state[2:4].copy()
            if planner.goal.error(state[X : ANGLE + 1]) < 1.5:
                break
        assert planner.goal.error(state[X : ANGLE + 1]) < 1.5


def test_an_object_stays_off_the_walls(planner):
    pose = np.array([120.0, 130.0, 0.3])
    plan = planner.plan(pose, np.array([400.0, 400.0]), np.zeros(2), 1.5)
    corners = plan.expected[:2] + (TEE.vertices - ORIGIN) @ rotation(plan.expected[2]).T
    assert corners.min() >= 8
    assert corners.max() <= 503


def test_a_finger_inside_the_object_leaves_it_first(planner):
    pose = np.array([250.0, 250.0, 0.0])
    plan = planner.plan(pose, pose[:2] + [0.0, -30.0], np.zeros(2), 1.5)
    assert plan.pushes == 0
    end, speed = pose[:2] + [0.0, -30.0], np.zeros(2)
    for command in plan.commands:
        end, speed = planner.model.drive.after(end, speed, command)
    assert end == pytest.approx(pose[:2] + [0, -45 - 21], abs=1e-6)


def test_no_plan_where_the_finger_can_stand_nowhere(planner):
    cramped = Planner(
        planner.table,
        planner.model,
        planner.goal,
        Workspace(finger_walls=box(245, 255)),
        effort=Effort(width=8),
    )
    assert cramped.plan(np.array([250.0, 250.0, 0.0]), np.array([248.0, 480.0]), np.zeros(2), 1.5) is None


def test_wrapped_angles_do_not_matter(planner):
    pose = np.array([200.0, 210.0, 1.0])
    turned = pose + [0, 0, 2 * np.pi]
    first, second = (planner.plan(p, np.array([60.0, 60.0]), np.zeros(2), 1.5) for p in (pose, turned))
    assert first.commands == pytest.approx(second.commands, abs=1e-6)
    assert wrapped(first.expected[2] - second.expected[2]) == pytest.approx(0, abs=1e-9)


def test_a_table_under_another_model_holds_the_same_pushes(planner):
    table = planner.table
    same = again(planner.model, table)
    for name in ("parameters", "shifts", "fingers", "steps", "first"):
        assert (getattr(same, name) == getattr(table, name)).all()
    heavier = replace(planner.model, block=replace(planner.model.block, gyration=9000.0))
    other = again(heavier, table)
    kept = {tuple(row) for row in table.parameters}
    assert {tuple(row) for row in other.parameters} <= kept
    assert np.abs(other.shifts[:, 2]).max() < np.abs(table.shifts[:, 2]).max()
    assert other.first[-1] == len(other.parameters)


def test_all_pushes_of_a_plan_make_it_exact_where_the_last_one_cannot():
    model = square_model()
    table = push_table(model, COARSE)
    start, goal = np.zeros(3), Goal(SQUARE, np.zeros(2), np.array([75.0, 20.0, 0.4]), symmetric=False)
    first = int(np.argmin(goal.error(composed(start[None], table.shifts))))
    chain = table.parameters[[first, (first + 30) % len(table.parameters), first]]
    before = goal.error(table_end(table, start, chain))
    better, error = refine_plan(table, goal, start, chain, 30, 1.0, 1e-3)
    assert error == pytest.approx(float(goal.error(table_end(table, start, better))), abs=1e-6)
    assert error < 0.1 * before


def table_end(table, start, chain):
    """Pose after all pushes."""
    pose = start[None]
    for push in chain:
        pose = composed(pose, table.outcomes(push[None])[0])
    return pose[0]
