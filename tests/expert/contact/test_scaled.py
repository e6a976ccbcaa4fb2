"""A task without dimension: the same whatever the units, wherever the world's origin is."""

from dataclasses import replace

import numpy as np
import pytest

from expert.contact.scaled import ScaledTask, belonging, end_points, finger_rays
from expert.geometry.pose import to_world
from expert.problems.contact import ContactTask
from expert.world.motion import Trajectory
from expert.world.shape import Body
from tests.support.random_tasks import floor_task, table_task


def moved(task: ContactTask, by: np.ndarray) -> ContactTask:
    walls = tuple(replace(w, point=w.point + by) for w in task.environment.walls)
    poses = task.trajectory.poses + [*by, 0]
    ends = {end: getattr(task.trajectory, end) + [*by, 0] for end in ("before", "after")}
    return replace(
        task,
        environment=replace(task.environment, walls=walls),
        trajectory=replace(task.trajectory, poses=poses, **ends),
    )


@pytest.mark.parametrize("case", [0, 1])
def test_where_the_world_has_its_origin_does_not_matter(case: int) -> None:
    task = (floor_task, table_task)[case](np.random.default_rng(3))
    here, there = ScaledTask.of(task), ScaledTask.of(moved(task, np.array([3.0, -2.0])))
    for name in set(ScaledTask._fields) - {"origin"}:
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-9, err_msg=name)


def test_a_heavier_world_differs_in_its_cost_alone() -> None:
    """Twice the mass under fingers and supports twice as strong: accelerations weigh a quarter in (m g)^2."""
    task = table_task(np.random.default_rng(4))
    body = Body(vertices=task.body.vertices, mass=2 * task.body.mass, inertia=2 * task.body.inertia)
    fingers = replace(task.fingers, max_force=2 * task.fingers.max_force)
    light, heavy = ScaledTask.of(task), ScaledTask.of(replace(task, body=body, fingers=fingers))
    assert heavy.acceleration_weight == pytest.approx(light.acceleration_weight / 4)
    for name in ("required", "rays", "limit", "max_force", "region", "force_weight"):
        np.testing.assert_allclose(getattr(heavy, name), getattr(light, name), atol=1e-12, err_msg=name)


def test_end_points_are_the_object_s_vertices() -> None:
    task = floor_task(np.random.default_rng(5))
    s = ScaledTask.of(task)
    vertices = to_world(task.trajectory.poses, task.body.vertices)
    world = s.origin + s.size * (s.centre[:, None, None] + end_points(s))
    np.testing.assert_allclose(world[:, :, 0], vertices, atol=1e-12)
    np.testing.assert_allclose(world[:, :, 1], np.roll(vertices, -1, axis=1), atol=1e-12)


def test_rays_lie_on_the_edges_of_their_cones() -> None:
    s = ScaledTask.of(floor_task(np.random.default_rng(5)))
    rays = finger_rays(s)
    np.testing.assert_allclose(np.einsum("tfkd,tfd->tfk", rays, s.normal), 1)
    np.testing.assert_allclose(np.abs(np.einsum("tfkd,tfd->tfk", rays, s.tangent)), s.friction, atol=1e-12)


def test_every_ray_of_the_environment_belongs_to_one_group_with_a_limit() -> None:
    at_rest = table_task(np.random.default_rng(1))
    still = Trajectory.of(np.tile(at_rest.trajectory.poses[0], (3, 1)), 0.1)
    for task in (floor_task(np.random.default_rng(5)), replace(at_rest, trajectory=still)):
        s = ScaledTask.of(task)
        member = belonging(s)
        np.testing.assert_array_equal(member.sum(axis=2), s.group >= 0)
        assert (np.einsum("teg,tg->te", member, s.limit)[s.group >= 0] > 0).all()
        assert (s.group >= 0).any()
