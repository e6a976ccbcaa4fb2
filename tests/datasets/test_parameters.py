from dataclasses import replace

import numpy as np
import pytest

from datasets.label import Label
from datasets.parameters import (
    MechanicalParameters,
    contact_facets,
    field_shapes,
    intervals,
    parameters_of,
    sticking,
)
from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import cross, to_body
from expert.problems.contact import FREE, Cost, Plan
from tests.support.labelled import labels


@pytest.fixture(params=range(12))
def labelled(request: pytest.FixtureRequest) -> Label:
    facets = (4, 6) if request.param < 6 else (12, 12)
    return labels(6, facets)[request.param % 6]


@pytest.fixture
def P(labelled: Label) -> MechanicalParameters:
    return parameters_of(labelled.task, labelled.plan)


def test_a_finger_pushes_until_the_step_before_it_leaves() -> None:
    modes = np.array([[FREE, 2], [1, 2], [1, FREE], [1, FREE], [FREE, 3]])
    assert sticking(modes).T.tolist() == [[0, 1, 1, 0, 0], [1, 0, 0, 0, 1]]


def test_free_fingers_keep_the_facet_of_their_nearest_contact() -> None:
    modes = np.array([[FREE, FREE], [1, FREE], [FREE, FREE], [FREE, FREE], [4, FREE]])
    assert contact_facets(modes).T.tolist() == [[1, 1, 1, 4, 4], [0, 0, 0, 0, 0]]
    assert intervals(modes[:, 0]) == [slice(0, 1), slice(1, 2), slice(2, 4), slice(4, 5)]


def test_the_plan_keeps_to_the_facets_of_p(labelled: Label, P: MechanicalParameters) -> None:
    start, edge = P.facets[:, :, 0], P.facets[:, :, 1] - P.facets[:, :, 0]
    offset = labelled.plan.positions - start
    rho = (offset * edge).sum(-1) / (edge * edge).sum(-1)
    touching = labelled.plan.modes != FREE
    assert touching.any()
    distance = np.linalg.norm(offset - rho[..., None] * edge, axis=-1) / labelled.task.body.size
    assert distance[touching].max() < 1e-9
    assert rho[touching].min() > -1e-9
    assert rho[touching].max() < 1 + 1e-9
    held = P.stick[:-1] == 1
    assert np.abs(np.diff(rho, axis=0))[held].max() < 1e-9


def test_the_plan_keeps_to_the_cones_and_limits_of_p(labelled: Label, P: MechanicalParameters) -> None:
    weights = np.linalg.solve(np.swapaxes(P.cones, -1, -2), labelled.plan.forces[..., None])[..., 0]
    pushing = P.stick == 1
    assert pushing.any()
    assert weights[pushing].min() > -1e-7
    normal = weights.sum(-1)
    least, most = P.force_limits[..., 0], P.force_limits[..., 1]
    assert (normal >= least - 1e-7)[pushing].all()
    assert (normal <= most + 1e-7)[pushing].all()
    assert (labelled.plan.forces[~pushing] == 0).all()


def test_fingers_and_ground_balance_the_wrench_of_p(labelled: Label, P: MechanicalParameters) -> None:
    total = np.concatenate([labelled.plan.forces.sum(1), np.zeros((5, 1))], axis=1)
    arm = labelled.plan.positions - P.poses[:, None, :2]
    total[:, 2] = cross(arm, labelled.plan.forces).sum(1)
    for t in range(5):
        rays = P.external_cones[t].reshape(-1, 2) * np.repeat(P.external_contact[t], 2)[:, None]
        arms = np.repeat(P.external_points[t] - P.poses[t, :2], 2, axis=0)
        columns = np.column_stack([rays, cross(arms, rays)]).T
        missing = P.wrench[t] - total[t]
        reaction, *_ = np.linalg.lstsq(columns, missing, rcond=None)
        np.testing.assert_allclose(columns @ reaction, missing, atol=1e-7)


def test_regions_hold_the_free_fingers_and_keep_out_the_object(
    labelled: Label, P: MechanicalParameters
) -> None:
    task, plan = labelled.task, labelled.plan
    room = P.region_offsets - np.einsum("tchd,tcd->tch", P.region_normals, plan.positions)
    assert room.min() > -1e-9
    assert (P.region_normals[plan.modes != FREE] == 0).all()
    rng = np.random.default_rng(0)
    for t, c in np.argwhere(plan.modes == FREE):
        points = plan.positions[t, c] + rng.uniform(-2, 2, (400, 2)) * task.body.size
        inside = (points @ P.region_normals[t, c].T <= P.region_offsets[t, c]).all(axis=1)
        distance = signed_distance(task.body.vertices, to_body(P.poses[t], points[inside]))
        assert inside.any()
        assert distance.min() >= task.robustness.free_clearance - 1e-9
        for wall in task.environment.walls:
            assert wall.gap(points[inside]).min() >= task.fingers.clearance - 1e-9


def test_a_sliding_contact_has_one_ray_and_an_absent_one_none(
    labelled: Label, P: MechanicalParameters
) -> None:
    present = P.external_contact == 1
    assert (P.external_cones[~present] == 0).all()
    np.testing.assert_allclose(P.external_cones[present][..., 1], 1.0, atol=1e-9)  # on the floor, y is normal
    assert ((P.external_contact == 0) | present).all()


def refused(labelled: Label, field: str, **changes: object) -> None:
    with pytest.raises(InvalidProblem) as caught:
        parameters_of(replace(labelled.task, **changes), labelled.plan)  # type: ignore[arg-type]
    assert caught.value.field == field


def test_what_p_cannot_carry_is_refused() -> None:
    labelled = labels(6, (4, 6))[0]
    transverse = replace(labelled.task.environment, plane="transverse")
    refused(labelled, "environment.plane", environment=transverse)
    refused(labelled, "cost.margin", cost=Cost(margin=0.1))
    with pytest.raises(InvalidProblem, match=r"plan\.status: expected optimal or feasible, got infeasible"):
        parameters_of(labelled.task, Plan(status="infeasible"))


def test_regions_of_too_many_half_planes_are_refused() -> None:
    everyone = labels(6, (4, 6)) + labels(6, (12, 12))
    free = [one for one in everyone if (one.plan.modes == FREE).any()]
    assert free
    with pytest.raises(InvalidProblem, match="rows: expected at least 2 for the free finger"):
        parameters_of(free[0].task, free[0].plan, rows=1)


def test_p_checks_its_arrays(P: MechanicalParameters) -> None:
    assert {n: a.shape[1:] for n, a in P.named().items()} == field_shapes(2)
    with pytest.raises(InvalidProblem, match="cones: expected finite numbers"):
        replace(P, cones=np.full_like(P.cones, np.nan))
    with pytest.raises(InvalidProblem, match="wrench: expected shape"):
        replace(P, wrench=P.wrench[:, :2])
    with pytest.raises(ValueError, match="read-only"):
        P.poses[0] = 0
