"""Programs whose balance can be met only just are solved, and those that miss it say by how much."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from expert.contact.imbalance import nearly_balanced
from expert.geometry.pose import Array


def program(rng: np.random.Generator, missing: float) -> tuple[Array, Array, Array, Array]:
    """Five forces at their largest make the wrench, which is missed by so much: nothing else comes as near."""
    wrenches = rng.normal(size=(3, 5))
    towards = rng.normal(size=3)
    towards /= np.linalg.norm(towards)
    wrenches *= np.sign(towards @ wrenches)  # each helps
    b = np.concatenate([wrenches.sum(axis=1) + missing * towards, np.zeros(5), -np.ones(5)])
    A = np.concatenate([wrenches, np.eye(5), -np.eye(5)])
    return np.eye(5), np.zeros(5), A, b


@pytest.mark.parametrize("missing", [0.0, 1e-10, 1e-9, 1e-6, 0.1])
@pytest.mark.parametrize("seed", range(5))
def test_the_imbalance_is_the_least_there_is(seed: int, missing: float) -> None:
    H, g, A, b = program(np.random.default_rng(seed), missing)
    success, x, _, s = nearly_balanced(H, g, A, b, 400)
    assert success
    np.testing.assert_allclose(A[:3] @ x + s, b[:3], atol=1e-12)
    least = lsq_linear(A[:3], b[:3], (0, 1), "bvls", 1e-15)
    assert np.linalg.norm(s) <= np.sqrt(2 * least.cost) + 2e-10
    if missing == 0.0:
        np.testing.assert_allclose(x, 1.0, atol=1e-8)
    elif missing >= 1e-6:  # the springs' pull is the direction in which no force reaches any further
        assert s @ b[:3] > np.maximum(s @ A[:3], 0).sum()


def test_a_balance_with_room_costs_what_it_costs() -> None:
    """min |x|^2 / 2 with x0 + x1 = 1: both 1/2, multiplier 1/2."""
    A = np.concatenate([[[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]], np.eye(2)])
    success, x, y, s = nearly_balanced(np.eye(2), np.zeros(2), A, np.array([1.0, 0, 0, 0, 0]), 400)
    assert success
    np.testing.assert_allclose(x, 0.5, atol=1e-9)
    np.testing.assert_allclose(y, [0.5, 0, 0], atol=1e-6)
    assert np.abs(s).max() <= 1e-10
