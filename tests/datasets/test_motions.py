"""Random motions: from rest to rest, above the floor, each family with its own law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.motions import FAMILIES, Phase, TaskSettings, poses_of, sample_motion, sample_task, timed
from datasets.render import Camera
from datasets.shapes import Shapes
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.mechanics import external_contacts
from expert.problems.contact import ContactTask
from expert.world.shape import Body

KINDS = [Shapes(), Shapes(facets=(12, 12))]
seeds = st.integers(0, 2**32)


def drawn(seed: int, family: str, kind: Shapes) -> ContactTask:
    """The first of a few draws that the shape has room for."""
    for attempt in range(20):
        try:
            return sample_task(np.random.default_rng([seed, attempt]), family, kind)
        except InvalidProblem:
            continue
    raise AssertionError(f"20 shapes in a row without a motion of the family {family}")


def corners(task: ContactTask) -> Array:
    return to_world(task.trajectory.poses, task.body.vertices)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=25, deadline=None)
@given(seed=seeds, kind=st.sampled_from(KINDS))
def test_every_motion_starts_and_ends_at_rest_above_the_floor_and_in_view(
    family: str, seed: int, kind: Shapes
) -> None:
    task = drawn(seed, family, kind)
    motion, size = task.trajectory, Camera().size
    assert motion.poses.shape == (5, 3)
    assert np.array_equal(motion.before, motion.poses[0])
    assert np.array_equal(motion.after, motion.poses[-1])
    assert corners(task)[..., 1].min() > -1e-9
    pixels = Camera().to_pixels(corners(task))
    assert pixels.min() > 0
    assert pixels.max() < size
    assert motion.poses[0, 2] == 0
    start = corners(task)[0]
    assert (start[:, 1] < 1e-9).sum() >= 2
    assert start[0, 1] == pytest.approx(0, abs=1e-12)  # vertex 0 is the left end of the contact line
    assert start[0, 0] == start[start[:, 1] < 1e-9, 0].min()
    assert start[start[:, 1] < 1e-9, 0].max() > motion.poses[0, 0] > start[0, 0]  # stable


@settings(max_examples=40, deadline=None)
@given(seed=seeds, kind=st.sampled_from(KINDS))
def test_slides_keep_height_and_orientation(seed: int, kind: Shapes) -> None:
    poses = drawn(seed, "slide", kind).trajectory.poses
    assert np.abs(poses[:, 1:] - poses[0, 1:]).max() < 1e-12
    assert 0.01 <= abs(poses[-1, 0] - poses[0, 0]) <= 0.04


@settings(max_examples=40, deadline=None)
@given(seed=seeds, kind=st.sampled_from(KINDS), family=st.sampled_from(["pivot", "pivot_lift"]))
def test_pivots_hold_one_ground_vertex_still_and_mechanics_sees_it_stick(
    seed: int, kind: Shapes, family: str
) -> None:
    task = drawn(seed, family, kind)
    steps = 5 if family == "pivot" else 3
    path = corners(task)[:steps]
    travel = np.abs(path - path[0]).max(axis=(0, 2))
    pivot = int(travel.argmin())
    assert travel[pivot] < 1e-15
    assert (np.delete(path[-1, :, 1], pivot) > 1e-3 - 1e-9).all()
    assert 0.1 <= abs(task.trajectory.poses[steps - 1, 2]) <= 0.5
    contacts = [c for c in external_contacts(task) if c.step < steps - 1]
    assert {(c.step, c.vertex) for c in contacts} == {(t, pivot) for t in range(steps - 1)}
    assert all(len(c.rays) == 2 for c in contacts)  # the whole cone: no slip


@settings(max_examples=40, deadline=None)
@given(seed=seeds, kind=st.sampled_from(KINDS), family=st.sampled_from(["lift", "lift_rotate"]))
def test_lifts_leave_the_floor_at_once(seed: int, kind: Shapes, family: str) -> None:
    task = drawn(seed, family, kind)
    poses = task.trajectory.poses
    assert 0.01 <= poses[-1, 1] - poses[0, 1] <= 0.04
    assert abs(poses[-1, 0] - poses[0, 0]) <= 0.03
    turned = abs(poses[-1, 2])
    assert turned == 0 if family == "lift" else 0.1 <= turned <= 0.5
    assert corners(task)[1:, :, 1].min() > task.contact_tolerance
    assert external_contacts(task) == ()


@settings(max_examples=40, deadline=None)
@given(seed=seeds, kind=st.sampled_from(KINDS), family=st.sampled_from(["slide_lift", "pivot_lift"]))
def test_two_phases_meet_at_the_middle_frame(seed: int, kind: Shapes, family: str) -> None:
    poses = drawn(seed, family, kind).trajectory.poses
    first, second = poses[2] - poses[0], poses[4] - poses[2]
    assert 0.008 <= second[1] <= 0.025
    assert np.abs(second[[0, 2]]).max() < 1e-12
    if family == "slide_lift":
        assert 0.008 <= abs(first[0]) <= 0.025
        assert np.abs(first[1:]).max() < 1e-12
    else:
        assert np.linalg.norm(first[:2]) <= 0.025  # chord of an arc of at most 2.5 cm


def test_timing_is_smooth_from_rest_to_rest() -> None:
    h = 1e-6
    assert (timed(0.0), timed(0.5), timed(1.0)) == (0.0, 0.5, 1.0)
    assert abs(timed(h) - timed(0.0)) / h < 1e-5
    assert abs(timed(1.0) - timed(1 - h)) / h < 1e-5


def test_a_full_turn_about_a_pivot_returns_the_pose() -> None:
    pivot = np.array([0.3, -0.2])
    poses = poses_of(np.array([0.1, 0.2, 0.0]), [Phase(angle=2 * np.pi, pivot=pivot)], 9)
    assert np.allclose(poses[-1], [0.1, 0.2, 2 * np.pi])
    assert np.ptp(np.linalg.norm(poses[:, :2] - pivot, axis=1)) < 1e-15


def test_a_body_in_any_frame_can_be_given() -> None:
    body, _ = Body.uniform(to_world([0.3, 0.1, 0.7], [[0, 0], [0.06, 0], [0.06, 0.04], [0, 0.04]]), 0.1)
    motion = sample_motion(np.random.default_rng(0), body, "lift", steps=7, dt=0.05)
    assert motion.poses.shape == (7, 3)
    start = to_world(motion.poses[0], body.vertices)
    assert (np.abs(start[:, 1]) < 1e-12).sum() == 2


def test_tasks_carry_the_margins_that_let_plans_survive() -> None:
    task = sample_task(np.random.default_rng(0), "lift", tasks=TaskSettings(facet_margin=0.2))
    weight = 0.1 * 9.81
    assert task.fingers.max_force == pytest.approx(10 * weight)
    assert task.fingers.facet_margin == 0.2
    assert task.robustness.min_normal_force == pytest.approx(0.04 * weight)
    assert (task.robustness.cone_fraction, task.robustness.support_inset) == (0.7, 0.3)
    assert task.body.mass == 0.1


def test_an_unknown_family_and_a_shape_without_room_are_refused() -> None:
    rng = np.random.default_rng(0)
    square, _ = Body.uniform([[0, 0], [0.05, 0], [0.05, 0.05], [0, 0.05]], 0.1)
    with pytest.raises(InvalidProblem, match=r"^family: expected one of slide, .* got throw"):
        sample_motion(rng, square, "throw")
    crumb, _ = Body.uniform(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 1e-3, 0.1)
    with pytest.raises(
        InvalidProblem, match=r"^object: expected a shape with room for the motion pivot_lift"
    ):
        sample_motion(rng, crumb, "pivot_lift")
