"""The shortest vector on one side of a few planes, against a quadratic solver written apart and by hand."""

import numpy as np
import pytest
from scipy.optimize import nnls

from expert.numeric.least_norm import least_norm
from expert.numeric.qp import SOLVED, solve_qp


def random_rows(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    A = rng.normal(size=(count, 3))
    return A / np.linalg.norm(A, axis=1)[:, None], rng.normal(size=count)


@pytest.mark.parametrize("seed", range(60))
def test_the_shortest_vector_is_the_quadratic_program_s(seed: int) -> None:
    A, b = random_rows(seed)
    u = np.empty(3)
    found = least_norm(A, b, len(b), u)
    status, x, _ = solve_qp(np.eye(3), np.zeros(3), A, b, np.int64(0), 400)
    assert found == (status == SOLVED)
    if found:
        np.testing.assert_allclose(u, x, atol=1e-9)


def test_without_a_solution_weights_of_the_rows_say_so() -> None:
    """Farkas: no u with A u >= b exists just where some w >= 0 has A'w = 0 and b.w > 0."""
    verdicts = []
    for seed in range(60):
        A, b = random_rows(seed)
        _, misfit = nnls(np.vstack([A.T, b]), np.array([0.0, 0.0, 0.0, 1.0]))
        verdicts.append(misfit < 1e-9)
        assert least_norm(A, b, len(b), np.empty(3)) != verdicts[-1]
    assert 5 < sum(verdicts) < 55


def test_rows_beyond_the_count_are_not_read() -> None:
    u = np.empty(3)
    A = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    assert least_norm(A, np.array([2.0, 2.0]), 1, u)
    np.testing.assert_allclose(u, [2, 0, 0])
    assert not least_norm(A, np.array([2.0, 2.0]), 2, u)
