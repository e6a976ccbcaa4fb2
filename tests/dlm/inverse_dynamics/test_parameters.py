import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.parameters import parameters_of
from dlm.inverse_dynamics.parameters import FLAGS, Layout, ParameterBatch
from expert.errors import InvalidProblem
from tests.support.labelled import labels

LAYOUT = Layout()


@pytest.fixture(scope="module")
def batch() -> ParameterBatch:
    return ParameterBatch.stack([parameters_of(one.task, one.plan) for one in labels(6, (4, 6))])


@settings(deadline=None)
@given(st.integers(1, 3), st.integers(1, 4), st.integers(1, 3), st.floats(0.01, 10), st.floats(0.01, 10))
def test_flatten_inverts_unflatten(
    fingers: int, rows: int, external: int, length: float, force: float
) -> None:
    layout = Layout(fingers=fingers, rows=rows, external=external, length=length, force=force)
    flat = torch.randn(2, 5, layout.width, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(layout.flatten(layout.unflatten(flat)), flat)


def test_unflatten_inverts_flatten(batch: ParameterBatch) -> None:
    again = LAYOUT.unflatten(LAYOUT.flatten(batch))
    for name, value in batch.named().items():
        torch.testing.assert_close(again.named()[name], value)


def test_each_number_has_one_column() -> None:
    columns = torch.arange(float(LAYOUT.width)).expand(1, 1, -1)
    parts = [part.flatten() for part in LAYOUT.split(columns).values()]
    assert torch.equal(torch.cat(parts), torch.arange(float(LAYOUT.width)))


def test_true_parameters_are_of_order_one(batch: ParameterBatch) -> None:
    relevant = LAYOUT.relevance(batch) == 1
    for name, (value, weight) in {
        n: (v, LAYOUT.split(relevant)[n]) for n, v in LAYOUT.split(LAYOUT.flatten(batch)).items()
    }.items():
        if weight.any():
            assert value[weight].abs().max() < 12, name


def test_gradients_pass_through_unflatten_in_units_of_the_scales() -> None:
    flat = torch.zeros(1, 5, LAYOUT.width, dtype=torch.float64, requires_grad=True)
    parameters = LAYOUT.unflatten(flat)
    (parameters.reference_forces.sum() + parameters.facets.sum()).backward()
    gradient = LAYOUT.split(flat.grad)
    assert (gradient["reference_forces"] == LAYOUT.force).all()
    assert (gradient["facets"] == LAYOUT.length).all()
    assert (gradient["poses"] == 0).all()


def test_squash_bounds_the_flags_and_nothing_else() -> None:
    logits = 5 * torch.randn(3, 5, LAYOUT.width, generator=torch.Generator().manual_seed(0))
    before, after = LAYOUT.split(logits), LAYOUT.split(LAYOUT.squash(logits))
    for name, value in after.items():
        if name in FLAGS:
            torch.testing.assert_close(value, before[name].sigmoid())
        else:
            assert torch.equal(value, before[name])


def test_fillers_have_no_weight(batch: ParameterBatch) -> None:
    weight = LAYOUT.split(LAYOUT.relevance(batch))
    assert torch.equal(weight["facets"].amax((-1, -2)), batch.contact)
    assert torch.equal(weight["external_points"].amax(-1), batch.external_contact)
    assert (weight["poses"] == 1).all()
    assert 0 < weight["region_normals"].mean() < 1


def test_bad_batches_are_refused(batch: ParameterBatch) -> None:
    with pytest.raises(InvalidProblem, match="tasks: expected at least one task"):
        ParameterBatch.stack([])
    with pytest.raises(InvalidProblem, match="cones: expected shape"):
        ParameterBatch(**{**batch.named(), "cones": batch.cones[:, :, :1]})
    with pytest.raises(InvalidProblem, match="flat: expected"):
        LAYOUT.unflatten(torch.zeros(1, 5, LAYOUT.width + 1))


def test_map_acts_on_every_field(batch: ParameterBatch) -> None:
    half = batch.map(lambda value: value[:3])
    assert all(len(value) == 3 for value in half.named().values())
