"""Where fingers may be: ranges on facets against sampling, regions against distances, the parking place and the workspace."""

from dataclasses import replace

import numpy as np
import pytest

from expert.geometry.polygon import signed_distance
from expert.geometry.pose import to_body, to_world
from expert.mechanics import parking_place, region_rows, rho_limits, wall_rows, workspace
from expert.problems.contact import ContactTask, Robustness
from tests.support.random_tasks import floor_task, table_task


def tasks() -> list[ContactTask]:
    rough = Robustness(free_clearance=0.004)
    return [
        floor_task(np.random.default_rng(0), robustness=rough),
        floor_task(np.random.default_rng(1), facets=6),
        table_task(np.random.default_rng(2)),
    ]


@pytest.mark.parametrize("case", range(3))
def test_ranges_on_facets_are_what_margin_and_walls_leave(case: int) -> None:
    task = tasks()[case]
    task = replace(task, fingers=replace(task.fingers, facet_margin=0.1, clearance=0.003))
    a, b = task.body.facets_w(task.trajectory.poses)
    low, high = rho_limits(task, a, b)
    for rho in np.linspace(0, 1, 41):
        point = a + rho * (b - a)
        clear = np.full(low.shape, 0.1 <= rho <= 0.9)
        for wall in task.environment.walls:
            clear &= wall.gap(point) >= task.fingers.clearance
        inside = (low <= rho) & (rho <= high)
        near_an_end = (np.abs(rho - low) < 1e-9) | (np.abs(rho - high) < 1e-9)
        assert ((inside == clear) | near_an_end).all()


def test_walls_are_kept_at_the_clearance() -> None:
    task = tasks()[0]
    (row,) = wall_rows(task)
    np.testing.assert_allclose(row, [0, 1, task.fingers.clearance])
    assert wall_rows(tasks()[2]).shape == (0, 3)


@pytest.mark.parametrize("case", range(3))
def test_regions_cover_what_is_clear_of_the_object_and_nothing_else(case: int) -> None:
    task = tasks()[case]
    regions = region_rows(task)
    rng = np.random.default_rng(case)
    for t, pose in enumerate(task.trajectory.poses):
        points = pose[:2] + 2 * task.body.size * rng.uniform(-1, 1, (200, 2))
        covered = (regions[t, ..., :2] @ points.T <= regions[t, ..., 2:]).all(axis=1).any(axis=0)
        distance = signed_distance(task.body.vertices, to_body(pose, points))
        assert (distance[covered] >= task.robustness.free_clearance - 1e-9).all()
        assert covered[distance > 3 * task.robustness.free_clearance + 1e-9].all()


@pytest.mark.parametrize("case", range(3))
def test_a_parked_finger_is_in_nobody_s_way(case: int) -> None:
    task = tasks()[case]
    place = parking_place(task)
    for pose in task.trajectory.poses:
        distance = signed_distance(task.body.vertices, to_body(pose, place[None]))
        assert distance > task.robustness.free_clearance
    assert all(w.gap(place) >= task.fingers.clearance for w in task.environment.walls)
    low, high = workspace(task)
    assert ((low <= place) & (place <= high)).all()


def test_the_workspace_holds_the_object_all_the_time() -> None:
    for task in tasks():
        vertices = to_world(task.trajectory.poses, task.body.vertices)
        low, high = workspace(task)
        assert (vertices >= low + task.body.size).all()
        assert (vertices <= high - task.body.size).all()
