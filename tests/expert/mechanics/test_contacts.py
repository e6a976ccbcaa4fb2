"""What walls and support may do, read from the motion, in small examples that can be worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.geometry.pose import to_world
from expert.mechanics import (
    external_contacts,
    required_wrench,
    wrench_about,
)
from expert.problems.contact import SUPPORT, ContactTask, Robustness
from expert.world.motion import Trajectory
from expert.world.walls import HalfPlane
from tests.support.hand_plans import (
    FLOOR_FRICTION,
    SUPPORT_FRICTION,
    WEIGHT,
    A,
    lifted_block,
    pushed_block,
    sliding_block,
    task_of,
)

MU = FLOOR_FRICTION


def pivot(steps: int = 5) -> ContactTask:
    """The block turns clockwise about its lower right corner, which stays at (A, 0) and rises beyond the horizon."""
    angles = -np.linspace(0, np.pi / 4, steps)
    corner = np.array([A, -A])
    centres = np.array([[A, 0.0] - to_world([0, 0, angle], corner[None])[0] for angle in angles])
    return task_of(np.column_stack([centres, angles]), count=1)


def test_an_exact_pivot_sticks_at_its_corner_alone() -> None:
    contacts = external_contacts(pivot())
    assert [(c.step, c.vertex, c.wall) for c in contacts] == [(t, 1, 0) for t in range(4)]
    for c in contacts:
        np.testing.assert_allclose(c.point, [A, 0], atol=1e-15)
        np.testing.assert_allclose(sorted(c.rays.tolist()), [[-MU, 1], [MU, 1]], atol=1e-15)


@pytest.mark.parametrize("direction", [1, -1])
def test_sliding_keeps_the_edge_against_the_motion(direction: int) -> None:
    task, _ = sliding_block()
    mirrored = Trajectory.of(task.trajectory.poses * [direction, 1, 1], 0.1)
    contacts = external_contacts(replace(task, trajectory=mirrored))
    assert {(c.step, c.vertex) for c in contacts} == {(t, v) for t in range(5) for v in (0, 1)}
    for c in contacts:
        np.testing.assert_allclose(c.rays, [[-direction * MU, 1]], atol=1e-15)


def test_lifting_leaves_the_floor_at_once() -> None:
    assert external_contacts(lifted_block()[0]) == ()


def test_landing_takes_force_from_the_step_that_stays() -> None:
    poses = [[0, A + 0.02, 0], [0, A + 0.01, 0], [0, A, 0], [0, A, 0]]
    steps = {c.step for c in external_contacts(task_of(poses, count=1))}
    assert steps == {2, 3}


def test_a_slip_below_the_tolerance_sticks() -> None:
    slip = 0.5 * sliding_block()[0].contact_tolerance
    task = task_of([[slip * t, A, 0] for t in range(3)], count=1)
    assert all(len(c.rays) == 2 for c in external_contacts(task))


def test_between_two_walls_each_touch_is_a_contact() -> None:
    task, _ = sliding_block()
    still = Trajectory.of([[0, A, 0]] * 3, 0.1)
    wall = HalfPlane(point=np.array([A, 0.0]), normal=np.array([-1.0, 0.0]), friction=0.2)
    walls = (*task.environment.walls, wall)
    contacts = external_contacts(
        replace(task, trajectory=still, environment=replace(task.environment, walls=walls))
    )
    assert {(c.vertex, c.wall) for c in contacts} == {(0, 0), (1, 0), (1, 1), (2, 1)}
    (high,) = (c for c in contacts if (c.step, c.vertex) == (0, 2))
    np.testing.assert_allclose(sorted(high.rays.tolist()), [[-1, -0.2], [-1, 0.2]])


def test_insets_and_cone_fractions_narrow_what_the_floor_may_do() -> None:
    robust = Robustness(support_inset=0.3, cone_fraction=0.7)
    still = replace(task_of([[0, A, 0]] * 3, count=1), robustness=robust)
    left, right = external_contacts(still)[:2]
    np.testing.assert_allclose([left.point[0], right.point[0]], [-0.4 * A, 0.4 * A])
    np.testing.assert_allclose(np.abs(left.rays[:, 0]), 0.7 * MU)
    sliding = replace(sliding_block()[0], robustness=robust)
    np.testing.assert_allclose(
        external_contacts(sliding)[0].rays, [[-MU, 1]]
    )  # sliding friction is what it is


# Support of the transverse plane


def test_a_sliding_support_drags_each_corner_against_its_velocity() -> None:
    task, _ = pushed_block()
    contacts = external_contacts(task)
    assert [(c.step, c.vertex) for c in contacts] == [(t, v) for t in range(5) for v in range(4)]
    assert all(c.fixed and c.wall == SUPPORT for c in contacts)
    for c in contacts:
        np.testing.assert_allclose(c.rays, [[-SUPPORT_FRICTION * WEIGHT / 4, 0]], atol=1e-15)


def test_turning_in_place_is_opposed_by_a_pure_moment() -> None:
    """Each corner, A sqrt(2) from the centre, is dragged with mu m g / 4: together mu m g A sqrt(2)."""
    angle = 1e-3  # small, so that chords are tangents
    task = task_of([[0, 0, angle * t] for t in range(3)], count=2, plane="transverse")
    wrench = required_wrench(task, external_contacts(task))
    moment = SUPPORT_FRICTION * WEIGHT * A * np.sqrt(2)
    np.testing.assert_allclose(wrench, np.tile([0, 0, moment], (3, 1)), atol=1e-6 * WEIGHT)


def test_a_resting_support_offers_an_octagon_inside_the_friction_disc() -> None:
    task = task_of([[0, 0, 0]] * 2, count=1, plane="transverse")
    contacts = external_contacts(task)
    assert len(contacts) == 8
    assert not any(c.fixed for c in contacts)
    disc = SUPPORT_FRICTION * WEIGHT / 4
    for c in contacts:
        np.testing.assert_allclose(np.linalg.norm(c.rays, axis=1), disc)
        inradius = (c.rays + np.roll(c.rays, -1, axis=0)) / 2
        np.testing.assert_allclose(np.linalg.norm(inradius, axis=1), disc * np.cos(np.pi / 8))
        assert c.limit == 1


@given(st.lists(st.floats(0, 1), min_size=8, max_size=8))
def test_every_force_of_the_octagon_lies_in_the_disc(weights: list[float]) -> None:
    contact = external_contacts(task_of([[0, 0, 0]] * 2, count=1, plane="transverse"))[0]
    w = np.array(weights) / max(1.0, sum(weights))
    assert np.linalg.norm(w @ contact.rays) <= SUPPORT_FRICTION * WEIGHT / 4 * (1 + 1e-12)


def test_fingers_that_push_a_sliding_block_balance_it() -> None:
    """The hand-made plan: required wrench minus the floor's forces is what the finger exerts."""
    for task, plan in (sliding_block(), pushed_block(), lifted_block()):
        wrench = required_wrench(task, external_contacts(task))
        for c in plan.contact_forces:
            if c.wall != SUPPORT:  # fixed support forces are already counted
                wrench[c.step] -= wrench_about(c.force, c.point, task.trajectory.poses[c.step, :2])
        centre = task.trajectory.poses[:, None, :2]
        pushed = wrench_about(plan.forces, plan.positions, centre).sum(axis=1)
        np.testing.assert_allclose(pushed, wrench, atol=1e-12)
