import numpy as np
import torch
from torch import Tensor

from dlm.inverse_dynamics.kkt import InteriorPointKKT, Pattern
from dlm.inverse_dynamics.layer import InverseDynamics
from tests.support.programs import BACKENDS, LAYOUT, assert_clips, score


def test_two_backends_agree(generic: Tensor) -> None:
    actions, gradients = [], []
    for backend in BACKENDS:
        rows = generic.clone().requires_grad_()
        action = InverseDynamics(backend=backend)(LAYOUT.unflatten(rows))  # type: ignore[arg-type]
        score(action).sum().backward()
        actions.append(action)
        gradients.append(rows.grad.flatten(1))
    torch.testing.assert_close(actions[0].positions, actions[1].positions, rtol=0, atol=1e-5)
    torch.testing.assert_close(actions[0].forces, actions[1].forces, rtol=0, atol=1e-3)
    assert torch.cosine_similarity(*gradients).min() > 0.999


def test_a_program_with_a_known_answer_and_one_without() -> None:
    assert_clips(InteriorPointKKT())


def test_entries_at_the_same_place_add_up() -> None:
    pattern = Pattern(np.array([1, 0, 1]), np.array([2, 0, 2]), (2, 3))
    assert pattern.matrix(np.array([1.0, 5.0, 3.0])).toarray().tolist() == [[5, 0, 0], [0, 0, 4]]
