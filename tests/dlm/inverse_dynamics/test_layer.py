from dataclasses import replace

import pytest
import torch
from torch import Tensor

from dlm.inverse_dynamics.data import QPSize
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.problems.contact import Cost
from tests.support.programs import BACKENDS, LAYOUT, score

WITHIN = 1e-4
"""Bar of the equality test: positions over L, forces over m g."""


def misses(action: Action, everyone: list, truth: ParameterBatch) -> Tensor:
    """Largest deviation from the expert's plan, (b,): positions where a finger touches, over L, and forces, over m g."""
    size = torch.tensor([one.task.body.size for one in everyone], dtype=torch.float64)
    weight = torch.tensor([one.task.weight for one in everyone], dtype=torch.float64)
    position = (action.positions - truth.reference_positions).abs().amax(-1) * truth.contact
    force = (action.forces - truth.reference_forces).abs()
    return torch.maximum(position.amax((1, 2)) / size, force.amax((1, 2, 3)) / weight)


@pytest.mark.parametrize("slack", [None, 300.0])
@pytest.mark.parametrize("backend", BACKENDS)
def test_at_the_truth_the_optimum_is_the_expert_s_plan(
    backend: str, slack: float | None, everyone: list, truth: ParameterBatch
) -> None:
    with torch.no_grad():
        action = InverseDynamics(backend=backend, slack=slack)(truth)  # type: ignore[arg-type]
    assert action.solved.all()
    assert misses(action, everyone, truth).max() < WITHIN
    assert action.slack.abs().max() < 1e-5


def test_stored_tasks_keep_the_equality(tasks: TaskBatch) -> None:
    with torch.no_grad():
        action = InverseDynamics(backend="batched", slack=None)(tasks.parameters)
    touching = tasks.parameters.contact[..., None]
    position = (action.positions - tasks.positions).abs() * touching / tasks.size[:, None, None, None]
    force = (action.forces - tasks.forces).abs() / tasks.weight[:, None, None, None]
    assert action.solved.all()
    assert position.max() < WITHIN
    assert force.max() < WITHIN


def test_without_its_ingredients_p_misses_the_plan(everyone: list, truth: ParameterBatch) -> None:
    """The equality test can fail, and does so when P loses what the expert imposes."""
    layer = InverseDynamics(backend="batched")
    thesis = InverseDynamics(backend="batched", torque="thesis")
    unheld = replace(truth, stick=truth.contact)  # pushes at release too, at another place
    untied = replace(truth, cones=2 * truth.cones - truth.cones.flip(-2))  # wider cones
    for other, parameters in ((thesis, truth), (layer, unheld), (layer, untied)):
        with torch.no_grad():
            missed = misses(other(parameters), everyone, truth) > WITHIN
        assert missed.any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_gradients_agree_with_finite_differences(backend: str, generic: Tensor) -> None:
    layer = InverseDynamics(backend=backend)  # type: ignore[arg-type]
    rows = generic.clone().requires_grad_()
    score(layer(LAYOUT.unflatten(rows))).sum().backward()
    noise = torch.Generator().manual_seed(1)
    directions = [torch.randn(rows.shape, generator=noise, dtype=rows.dtype) for _ in range(8)]
    exact = InverseDynamics(backend="batched")
    slopes = torch.stack([(rows.grad * d).sum((1, 2)) for d in directions])
    agree = torch.zeros(len(generic), dtype=torch.bool)
    for h in (
        1e-5,
        1e-6,
        1e-7,
    ):  # a large step crosses corners of the optimum, a small one drowns in the solver's noise
        with torch.no_grad():
            ends = [
                [score(exact(LAYOUT.unflatten(generic + s * h * d))) for s in (1, -1)] for d in directions
            ]
        differences = torch.stack([(ahead - behind) / (2 * h) for ahead, behind in ends])
        cosine = torch.cosine_similarity(slopes, differences, dim=0)
        ratio = slopes.norm(dim=0) / differences.norm(dim=0)
        agree |= (cosine > 0.999) & ((ratio - 1).abs() < 1e-2)
    assert agree.all(), agree


def test_positions_feel_the_cones_through_the_first_order_torque_alone(generic: Tensor) -> None:
    sizes = {}
    for torque in ("first_order", "thesis"):
        rows = generic.clone().requires_grad_()
        action = InverseDynamics(backend="batched", torque=torque)(LAYOUT.unflatten(rows))  # type: ignore[arg-type]
        action.positions.sum().backward()
        sizes[torque] = LAYOUT.split(rows.grad)["cones"].abs().amax((1, 2, 3, 4))
    assert (sizes["first_order"] > 1e-6).all()
    assert sizes["thesis"].max() < 1e-9


@pytest.mark.parametrize("backend", BACKENDS)
def test_slack_supplies_what_nobody_else_can(backend: str, truth: ParameterBatch) -> None:
    alone = replace(
        truth, stick=torch.zeros_like(truth.stick), external_contact=torch.zeros_like(truth.external_contact)
    ).map(lambda x: x[:2])
    with torch.no_grad():
        action = InverseDynamics(backend=backend, torque="thesis")(alone)  # type: ignore[arg-type]
    assert action.solved.all()
    torch.testing.assert_close(action.slack, alone.wrench, rtol=0, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("defect", ["nan", "infeasible"])
def test_an_unsolvable_item_never_spoils_its_batch(backend: str, defect: str, truth: ParameterBatch) -> None:
    layer = InverseDynamics(backend=backend, slack=None)  # type: ignore[arg-type]
    rows = LAYOUT.flatten(truth)[:4].clone()
    spoilt = LAYOUT.unflatten(rows)
    wrench, bad = spoilt.wrench.clone(), 2
    wrench[bad, 1] = torch.nan if defect == "nan" else 1e3  # more than any finger may push
    rows = LAYOUT.flatten(replace(spoilt, wrench=wrench)).requires_grad_()
    action = layer(LAYOUT.unflatten(rows))
    score(action).sum().backward()
    good = [0, 1, 3]
    assert action.solved.tolist() == [True, True, False, True]
    assert (action.positions[bad] == 0).all()
    assert (action.forces[bad] == 0).all()
    assert (rows.grad[bad] == 0).all()
    clean = LAYOUT.flatten(truth)[good].clone().requires_grad_()
    alone = layer(LAYOUT.unflatten(clean))
    score(alone).sum().backward()
    assert torch.equal(alone.positions, action.positions[good])
    assert torch.equal(clean.grad, rows.grad[good])


def random_rows(truth: ParameterBatch, count: int, seed: int) -> Tensor:
    """Half around the truth (noise of 0.01 to 1 times the scales), half pure noise of up to 10 times the scales."""
    source = torch.Generator().manual_seed(seed)
    flat = LAYOUT.flatten(truth)
    near = flat[torch.randint(len(flat), (count,), generator=source)]
    noise = torch.randn(near.shape, generator=source, dtype=flat.dtype)
    size = 10 ** (3 * torch.rand(count, 1, 1, generator=source, dtype=flat.dtype) - 2)
    pure = torch.arange(count)[:, None, None] % 2 == 1
    return torch.where(pure, LAYOUT.squash(size * noise), near + size.clamp(max=1) * noise)


def assert_no_nan(layer: InverseDynamics, rows: Tensor) -> float:
    """Share of solved items."""
    rows = rows.requires_grad_()
    action = layer(LAYOUT.unflatten(rows))
    (score(action).sum() + action.slack.abs().sum()).backward()
    for value in (action.positions, action.forces, action.slack, rows.grad):
        assert value.isfinite().all()
    assert (rows.grad[~action.solved] == 0).all()
    return float(action.solved.double().mean())


@pytest.mark.parametrize(("backend", "count", "solved"), [("cvxpylayers", 60, 0.6), ("batched", 600, 0.99)])
def test_random_parameters_give_no_nan(
    backend: str, count: int, solved: float, truth: ParameterBatch
) -> None:
    layer = InverseDynamics(backend=backend)  # type: ignore[arg-type]
    assert assert_no_nan(layer, random_rows(truth, count, seed=0)) >= solved


@pytest.mark.slow
def test_ten_thousand_random_parameters_give_no_nan(truth: ParameterBatch) -> None:
    layer = InverseDynamics(backend="batched")
    shares = [assert_no_nan(layer, random_rows(truth, 1000, seed)) for seed in range(1, 11)]
    assert min(shares) > 0.99


@pytest.mark.parametrize(
    ("field", "options"),
    [
        ("torque", {"torque": "second_order"}),
        ("backend", {"backend": "gurobi"}),
        ("slack", {"slack": 0.0}),
        ("cost.force", {"cost": Cost(force=0.0)}),
        ("cost.acceleration", {"cost": Cost(acceleration=0.0)}),
        ("cost.margin", {"cost": Cost(margin=1.0)}),
    ],
)
def test_bad_options_are_refused(field: str, options: dict) -> None:
    with pytest.raises(InvalidProblem) as caught:
        InverseDynamics(**options)
    assert caught.value.field == field


def test_sizes_that_do_not_fit_are_refused(truth: ParameterBatch) -> None:
    with pytest.raises(InvalidProblem, match="steps: expected at least 3"):
        QPSize(steps=2)
    with pytest.raises(InvalidProblem, match="parameters: expected QPSize"):
        InverseDynamics(QPSize(rows=3), backend="batched")(truth)
