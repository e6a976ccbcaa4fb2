import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlm.evaluation.significance import Comparison, compare_all, holm

PAIR = [("old", "new")]


def compare(old: np.ndarray, new: np.ndarray) -> Comparison:
    losses = {"old": {"test": old}, "new": {"test": new}}
    return compare_all(losses, PAIR, rng=np.random.default_rng(1))[0]


def draws(seed: int = 0, count: int = 40) -> np.ndarray:
    return np.random.default_rng(seed).exponential(size=count)


def test_a_row_against_itself_is_not_told_apart() -> None:
    found = compare(draws(), draws())
    assert (found.p_ranks, found.p_mean, found.difference) == (1, 1, 0)
    assert found.verdict == "not told apart"


def test_a_clear_gain_is_found_and_its_interval_holds_the_difference() -> None:
    found = compare(draws(), 0.5 * draws())
    assert found.verdict == "better"
    assert found.low < found.difference < found.high < 0
    assert found.better == 1
    assert compare(0.5 * draws(), draws()).verdict == "worse"


def test_few_drops_decide_the_mean_against_most_tasks() -> None:
    old, new = np.ones(40), np.full(40, 0.9)
    old += 0.001 * draws(2)
    new[:7] = 30.0
    assert compare(old, new).verdict == "worse in the mean, better on most tasks"


def test_noise_is_rarely_taken_for_a_difference() -> None:
    """Both tests keep their level: of 60 pairs that differ by noise alone, some 5 % have p < 0.05."""
    rng = np.random.default_rng(3)
    found = [compare(rng.normal(size=20), rng.normal(size=20)) for _ in range(60)]
    for name in ("p_ranks", "p_mean"):
        wrong = sum(getattr(c, name) < 0.05 for c in found)
        assert wrong <= 9, name  # 3 expected; more than 9 has a chance of 0.001


def test_four_tasks_can_never_tell() -> None:
    found = compare(draws(count=4), 0.1 * draws(count=4))
    assert found.p_mean == pytest.approx(2 / 2**4)
    assert found.verdict == "not told apart"


def test_more_comparisons_ask_for_more_evidence() -> None:
    losses = {"old": {"test": draws()}, "new": {"test": draws() + 0.1 * draws(5) - 0.05}}
    one = compare_all(losses, PAIR, rng=np.random.default_rng(1))[0]
    many = compare_all(losses, PAIR * 6, rng=np.random.default_rng(1))[0]
    assert many.p_ranks == pytest.approx(min(1, 6 * one.p_ranks))


def test_holm_on_the_textbook_example() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_holm_lies_between_no_correction_and_bonferroni(p: list[float]) -> None:
    adjusted = holm(p)
    assert adjusted[int(np.argmin(p))] == pytest.approx(min(1, len(p) * min(p)))
    assert all(a >= raw for raw, a in zip(p, adjusted, strict=True))
    order = np.argsort(p, kind="stable")
    assert np.all(np.diff(np.array(adjusted)[order]) >= 0)
