"""Each block of MIQP1: exact plans satisfy it, a binary of one forces its equation, a binary of zero frees it."""

from collections.abc import Callable

import cvxpy as cp
import numpy as np
import pytest

from expert.contact import solve as solve_exactly
from expert.contact import thesis_blocks as blocks
from expert.contact.scaled import ScaledTask, end_points
from expert.contact.thesis import blocks as all_blocks
from expert.contact.thesis import cost
from expert.contact.thesis_blocks import Variables
from expert.mip.block import Block
from expert.mip.solve import solve
from expert.problems.contact import ContactTask, Robustness
from tests.support.exact_points import assign, assign_cells
from tests.support.random_tasks import floor_task, table_task

SEGMENTS = 4
ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.02, min_interval=2, free_clearance=0.004
)


def some_tasks() -> list[ContactTask]:
    """Both planes, one and two fingers, with and without margins."""
    return [
        floor_task(np.random.default_rng(0), steps=4),
        floor_task(np.random.default_rng(1), steps=4, facets=5, robustness=ROBUST, margin=0.3),
        floor_task(np.random.default_rng(2), steps=3, fingers=1, margin=0.1),
        table_task(np.random.default_rng(3), steps=4),
    ]


@pytest.fixture(scope="module")
def task() -> ContactTask:
    return some_tasks()[1]


@pytest.fixture
def s(task: ContactTask) -> ScaledTask:
    return ScaledTask.of(task)


@pytest.fixture
def x(task: ContactTask, s: ScaledTask) -> Variables:
    return Variables.of(s, task.fingers.count, SEGMENTS)


@pytest.fixture
def largest(task: ContactTask) -> Callable[..., float]:
    """Largest value of an affine expression subject to blocks and further constraints, by linear programming."""

    def value(expression: cp.Expression, block: Block, *more: cp.Constraint) -> float:
        result = solve(cp.Problem(cp.Maximize(expression), [*block.constraints, *more]), solver="highs")
        assert result.status == "optimal", result
        return result.value

    return value


def feasible(block: Block, *more: cp.Constraint) -> bool:
    result = solve(cp.Problem(cp.Minimize(0), [*block.constraints, *more]), solver="highs")
    assert result.status in ("optimal", "infeasible")
    return result.status == "optimal"


@pytest.mark.parametrize("case", range(4))
def test_exact_plans_satisfy_every_block(case: int) -> None:
    task = some_tasks()[case]
    plan = solve_exactly(task)
    assert plan.found
    s = ScaledTask.of(task)
    x = Variables.of(s, task.fingers.count, SEGMENTS)
    program = all_blocks(x, s, task, SEGMENTS)
    copies = {
        v.name(): v
        for b in program
        for c in b.constraints
        for v in c.variables()
        if v.name() in ("u_k", "v_k")
    }
    assign(x, task, s, plan)
    assign_cells(x, s, SEGMENTS, copies)
    for block in program:
        assert max(float(np.max(c.violation())) for c in block.constraints) < 1e-7, block.label
    assert float(cost(x, s).value) * s.cost_unit == pytest.approx(plan.objective, rel=1e-6)


def test_ct1_leaves_no_force_unbalanced(x: Variables, s: ScaledTask, largest: Callable[..., float]) -> None:
    block = blocks.linear_dynamics(x, s)
    no_environment = x.alpha_e == 0
    for sign in (1, -1):
        total = sign * (cp.sum(x.lam[1], axis=0) - s.required[1, :2])
        assert largest(cp.sum(total), block, no_environment) == pytest.approx(0, abs=1e-9)
    assert not feasible(block, no_environment, x.lam[1] == 0)


def test_ct2_leaves_no_torque_unbalanced(x: Variables, s: ScaledTask, largest: Callable[..., float]) -> None:
    block = blocks.angular_dynamics(x, s)
    torque = cp.sum(x.tau[2, :, 0] - x.tau[2, :, 1]) + s.rays[2, :, 2] @ x.alpha_e[2]
    for sign in (1, -1):
        assert largest(sign * torque, block) == pytest.approx(sign * s.required[2, 2], abs=1e-9)


def on_facet(x: Variables, t: int, c: int, f: int) -> list[cp.Constraint]:
    """T fixed: finger c touches facet f at step t and nothing else."""
    return [x.T[t, c, f] == 1, cp.sum(x.T[t, c]) == 1]


def test_ct3_puts_a_touching_finger_on_its_facet_and_its_force_in_the_cone(
    x: Variables, s: ScaledTask, task: ContactTask, largest: Callable[..., float]
) -> None:
    margin, t, c, f = task.fingers.facet_margin, 1, 0, 2
    block = blocks.contact_assignment(x, s, margin)
    a, b = end_points(s)[t, f] + s.centre[t]
    edge, fixed = b - a, on_facet(x, t, c, f)
    normal = np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
    for sign in (1, -1):
        assert largest(sign * normal @ (x.p[t, c] - a), block, *fixed) == pytest.approx(0, abs=1e-8)
    along = edge @ (x.p[t, c] - a) / (edge @ edge)
    assert largest(along, block, *fixed) == pytest.approx(1 - margin, abs=1e-8)
    assert largest(-along, block, *fixed) == pytest.approx(-margin, abs=1e-8)
    mu = task.fingers.friction * task.robustness.cone_fraction
    others = [x.alpha[t, c, g] == 0 for g in range(s.facets) if g != f]
    for sign in (1, -1):
        outside = sign * (edge / np.linalg.norm(edge)) @ x.lam[t, c] - mu * normal @ x.lam[t, c]
        assert largest(outside, block, *fixed, *others) == pytest.approx(0, abs=1e-8)


def test_ct3_lets_a_free_finger_roam_the_workspace(
    x: Variables, s: ScaledTask, task: ContactTask, largest: Callable[..., float]
) -> None:
    block = blocks.contact_assignment(x, s, task.fingers.facet_margin)
    free = cp.sum(x.T[1, 0]) == 0
    for d in (0, 1):
        assert largest(x.p[1, 0, d], block, free) == pytest.approx(s.workspace[1, d])
        assert largest(-x.p[1, 0, d], block, free) == pytest.approx(-s.workspace[0, d])


def test_ct4_gives_force_to_contacts_alone_and_within_limits(
    x: Variables, s: ScaledTask, largest: Callable[..., float]
) -> None:
    block, last, f = blocks.complementarity(x, s), s.steps - 1, 1
    normal = cp.sum(x.alpha[last, 0, f])
    assert largest(normal, block, x.T[last, 0, f] == 0) == pytest.approx(0, abs=1e-9)
    assert largest(normal, block, x.T[last, 0, f] == 1) == pytest.approx(s.max_force)
    assert largest(-normal, block, x.T[last, 0, f] == 1) == pytest.approx(-s.min_force)
    assert s.min_force > 0


def test_ct5_sticks_through_an_interval_and_is_force_free_at_its_release(
    x: Variables, s: ScaledTask, largest: Callable[..., float]
) -> None:
    block = blocks.alternated_sticking(x, s, 1)
    moved = x.rho[1, 0, 0, 1] - x.rho[0, 0, 0, 1]
    push = cp.sum(x.alpha[0, 0, 0])
    stays = [x.T[0, 0, 0] == 1, x.T[1, 0, 0] == 1]
    leaves = [x.T[0, 0, 0] == 1, x.T[1, 0, 0] == 0]
    for sign in (1, -1):
        assert largest(sign * moved, block, *stays) == pytest.approx(0, abs=1e-9)
        assert largest(sign * moved, block, *leaves) == pytest.approx(1)
    assert largest(push, block, *leaves) == pytest.approx(0, abs=1e-9)
    assert largest(push, block, *stays) == pytest.approx(s.max_force)


def test_ct5_wants_a_free_step_between_two_facets(x: Variables, s: ScaledTask) -> None:
    block = blocks.alternated_sticking(x, s, 1)
    assert not feasible(block, x.T[0, 0, 0] == 1, x.T[1, 0, 1] == 1)
    assert feasible(block, x.T[0, 0, 0] == 1, cp.sum(x.T[1, 0]) == 0, x.T[2, 0, 1] == 1)


@pytest.mark.parametrize("step", [0, 1, -1])
def test_ct5_can_ask_for_contacts_that_last(x: Variables, s: ScaledTask, step: int) -> None:
    T = s.steps
    alone = np.zeros(T)
    alone[step] = 1
    assert feasible(blocks.alternated_sticking(x, s, 1), x.T[:, 0, 0] == alone)
    assert not feasible(blocks.alternated_sticking(x, s, 2), x.T[:, 0, 0] == alone)
    pair = np.zeros(T)
    pair[:2] = 1
    assert feasible(blocks.alternated_sticking(x, s, 2), x.T[:, 0, 0] == pair)


def test_ct6_keeps_reactions_in_their_cones_and_limits(
    x: Variables, s: ScaledTask, largest: Callable[..., float]
) -> None:
    block = blocks.environment_cones(x, s)
    pairs = np.argwhere((s.group[..., None] == np.arange(s.limit.shape[1])).any(axis=1))
    assert len(pairs) > 0
    for t, g in pairs:
        weights = x.alpha_e[t, np.flatnonzero(s.group[t] == g)]
        assert largest(cp.sum(weights), block) == pytest.approx(s.limit[t, g])
        normal = s.rays[t, s.group[t] == g, 1]
        np.testing.assert_allclose(normal, 1)  # floor: rays of unit normal component
        assert largest(-normal @ weights, block) == pytest.approx(0, abs=1e-9)
    assert largest(cp.sum(x.alpha_e), block) == pytest.approx(s.limit.sum())  # there are no other rays


def test_ct7_keeps_a_finger_in_its_region_and_off_the_walls(
    x: Variables, s: ScaledTask, task: ContactTask, largest: Callable[..., float]
) -> None:
    block, t, c = blocks.non_penetration(x, s), 1, 0
    for r in range(s.regions):
        inside = [x.R[t, c, r] == 1]
        for normal, b in zip(s.region[t, r, :, :2], s.region[t, r, :, 2], strict=True):
            if normal.any() and feasible(block, *inside):
                assert largest(normal @ x.p[t, c], block, *inside) <= b + 1e-8
    touching = [x.T[t, c, 0] == 1]
    assert largest(x.p[t, c, 1], block, *touching) == pytest.approx(s.workspace[1, 1])
    floor = (s.origin[1] - task.fingers.clearance) / s.size
    assert largest(-x.p[t, c, 1], block, *touching) == pytest.approx(floor)
    assert not feasible(block, *touching, x.R[t, c, 0] == 1)


def test_ct8_and_ct9_bound_the_torque_s_error_in_a_chosen_cell(
    x: Variables, s: ScaledTask, largest: Callable[..., float]
) -> None:
    block, cells = blocks.torque_envelopes(x, s, SEGMENTS), blocks.torque_cells(s, SEGMENTS)
    lever = blocks.lever_arm(x, s)[1, 0, 0]
    force = x.lam[1, 0, 1]
    k = 2
    at_centre = [
        x.W[1, 0, 0, k] == 1,
        lever == (cells.u_low[k] + cells.u_high[k]) / 2,
        force == (cells.v_low[k] + cells.v_high[k]) / 2,
    ]
    product = (cells.u_low[k] + cells.u_high[k]) / 2 * (cells.v_low[k] + cells.v_high[k]) / 2
    for sign in (1, -1):
        error = sign * (x.tau[1, 0, 0] - product)
        assert largest(error, block, *at_centre) == pytest.approx(cells.largest_error)
    for sign in (1, -1):
        at_corner = [x.W[1, 0, 0, k] == 1, lever == cells.u_low[k], force == cells.v_high[k]]
        error = sign * (x.tau[1, 0, 0] - cells.u_low[k] * cells.v_high[k])
        assert largest(error, block, *at_corner) == pytest.approx(0, abs=1e-8)
        no_cell = cp.sum(x.W[1, 0, 0]) == 0
        assert largest(sign * x.tau[1, 0, 0], block, no_cell) == pytest.approx(0, abs=1e-9)


def test_beta_is_the_distance_to_the_nearer_edge(
    x: Variables, s: ScaledTask, task: ContactTask, largest: Callable[..., float]
) -> None:
    mu = task.fingers.friction
    planned = mu * task.robustness.cone_fraction
    block = blocks.cone_distance(x, mu, planned)
    force = np.zeros(x.alpha.shape)
    force[1, 0, 2] = [0.7, 0.2]
    distance = (mu * 0.9 - planned * 0.5) / np.hypot(1, mu)
    assert largest(x.beta[1, 0], block, x.alpha == force) == pytest.approx(distance)
    assert largest(x.beta[0, 0], block, x.alpha == force) == pytest.approx(0, abs=1e-9)
