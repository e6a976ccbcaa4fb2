import torch

from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.policy import seeded
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.policies import ThesisArchitecture

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


def test_random_numbers_follow_the_seed_and_the_caller_s_go_on() -> None:
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    with seeded(1):
        one = torch.rand(3)
    assert torch.equal(torch.rand(3), expected)
    with seeded(1):
        assert torch.equal(torch.rand(3), one)
    with seeded(2):
        assert not torch.equal(torch.rand(3), one)


def test_the_constants_of_the_program_are_no_weights() -> None:
    policy = ThesisArchitecture(sizes=SMALL, layout=Layout()).build("program", InverseDynamics(), seed=0)
    names = set(policy.weights())
    assert {name for name, _ in policy.named_parameters()} <= names
    assert "derenderer.centre" in names
    assert not any(name.startswith("program.") for name in names)
    assert any(name.startswith("program.") for name in policy.state_dict())
