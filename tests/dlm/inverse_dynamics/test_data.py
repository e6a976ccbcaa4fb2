import pytest
import torch

from dlm.inverse_dynamics.data import QPSize, QPWeights, qp_data
from dlm.inverse_dynamics.parameters import ParameterBatch
from expert.problems.contact import Cost


def test_the_data_have_the_stated_shapes(truth: ParameterBatch) -> None:
    data = qp_data(truth, length=0.01, force=1.0, couple=True)
    tasks = len(truth.poses)
    assert {n: tuple(x.shape) for n, x in data.tensors().items()} == {
        n: (tasks, *shape) for n, shape in QPSize().shapes.items()
    }


def test_units_of_length_and_force_cancel(truth: ParameterBatch) -> None:
    """Twice the unit, half the number; torques by both; cones and flags not at all."""
    one = qp_data(truth, length=0.01, force=1.0, couple=True).tensors()
    two = qp_data(truth, length=0.02, force=3.0, couple=True).tensors()
    lengths = {"arm", "anchor", "start", "edge", "bounds", "ground_torque"}
    forces = {"couple", "least", "most"}
    for name, value in two.items():
        factor = 2.0 if name in lengths else 3.0 if name in forces else 6.0 if name == "offset" else 1.0
        scale = value.new_tensor([3.0, 3.0, 6.0]) if name == "wrench" else factor
        torch.testing.assert_close(value * scale, one[name], msg=name)


def test_without_coupling_the_torque_is_the_printed_one(truth: ParameterBatch) -> None:
    data = qp_data(truth, length=0.01, force=1.0, couple=False)
    assert not data.couple.any()
    assert not data.offset.any()


def test_flags_silence_what_they_say_is_not_there(truth: ParameterBatch) -> None:
    data = qp_data(truth, length=0.01, force=1.0, couple=True)
    assert not data.rays[truth.stick == 0].any()
    assert not data.ground_rays[truth.external_contact == 0].any()
    assert data.rays[truth.stick == 1].any()
    assert (data.least <= data.most).all()


def test_weights_are_the_expert_s_cost_in_units_of_the_program() -> None:
    cost = Cost(force=2.0, acceleration=3.0)
    weights = QPWeights.of(cost, dt=0.1, length=0.01, force=1.0, slack=None)
    assert weights.force == 2.0
    assert weights.acceleration == pytest.approx(3.0 * (0.01 / 0.1**2) ** 2)
