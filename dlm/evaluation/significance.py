"""Are two architectures told apart?  Tests over tasks, paired, corrected for their number.

What is compared are the losses of single tasks, each averaged over seeds first: tasks are independent draws, the seeds of
one task are not.  Wilcoxon's signed ranks ask whether differences lean to one side; random flips of their signs ask about
their mean, which a few dropped objects can decide, and the bootstrap says how far off that mean may be.  Both p values are two-sided, and corrected by Holm's method over all comparisons.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import bootstrap, permutation_test, wilcoxon

from expert.geometry.pose import Array

RESAMPLES = 19_999
LEVEL = 0.05
"""Of significance, after the correction."""

Losses = Mapping[str, Mapping[str, Array]]
"""Object-trajectory loss of every row on every data set, (tasks,), averaged over seeds [cm^2]."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """`second` against `first` on the tasks of one data set.

    difference: mean loss of second minus first, with its 95 % bootstrap interval (low, high) [cm^2]; median: of the same
    differences.  better: share of tasks that second does better.  p_ranks, p_mean: corrected p values of Wilcoxon's test and of sign flips.
    """

    first: str
    second: str
    dataset: str
    difference: float
    low: float
    high: float
    median: float
    better: float
    p_ranks: float
    p_mean: float

    @property
    def verdict(self) -> str:
        """What the tests tell of `second`: better or worse, in the mean, on most tasks, or both."""
        mean = _word(self.difference) if self.p_mean < LEVEL else None
        most = _word(self.median) if self.p_ranks < LEVEL else None
        if mean == most:
            return mean or "not told apart"
        parts = [f"{mean} in the mean"] * (mean is not None) + [f"{most} on most tasks"] * (most is not None)
        return ", ".join(parts)


def _word(change: float) -> str:
    return "worse" if change > 0 else "better"


def compare_all(
    losses: Losses, pairs: Sequence[tuple[str, str]], *, rng: np.random.Generator
) -> list[Comparison]:
    """Every pair (first, second) of rows on every data set, p values corrected over all of them."""
    raw = [
        _compare(losses[a][d], losses[b][d], first=a, second=b, dataset=d, rng=rng)
        for d in next(iter(losses.values()), {})
        for a, b in pairs
    ]
    ranks, means = (holm([getattr(c, name) for c in raw]) for name in ("p_ranks", "p_mean"))
    return [replace(c, p_ranks=r, p_mean=m) for c, r, m in zip(raw, ranks, means, strict=True)]


def _compare(
    a: Array, b: Array, *, first: str, second: str, dataset: str, rng: np.random.Generator
) -> Comparison:
    change = b - a
    low, high = _interval(change, rng)
    return Comparison(
        first=first,
        second=second,
        dataset=dataset,
        difference=float(change.mean()),
        low=low,
        high=high,
        median=float(np.median(change)),
        better=float((change < 0).mean()),
        p_ranks=float(wilcoxon(change).pvalue) if np.any(change) else 1.0,
        p_mean=_sign_flips(change, rng) if np.any(change) else 1.0,
    )


def _interval(change: Array, rng: np.random.Generator) -> tuple[float, float]:
    """95 % bootstrap interval of the mean."""
    if np.ptp(change) == 0:
        return float(change[0]), float(change[0])
    result = bootstrap((change,), np.mean, n_resamples=RESAMPLES, rng=rng, method="percentile")
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def _sign_flips(change: Array, rng: np.random.Generator) -> float:
    """p value of a mean of zero: exact where there are few tasks, which a bootstrap is not."""

    def mean(x: Array, axis: int = -1) -> Array:
        return np.asarray(x.mean(axis=axis))

    result = permutation_test(
        (change,), mean, permutation_type="samples", n_resamples=RESAMPLES, vectorized=True, rng=rng
    )
    return float(result.pvalue)


def holm(p: Sequence[float]) -> list[float]:
    """Holm's step-down correction: adjusted p values, in the order given."""
    adjusted, least, left = [0.0] * len(p), 0.0, len(p)
    for k in sorted(range(len(p)), key=lambda k: p[k]):
        least = max(least, min(1.0, left * p[k]))
        adjusted[k], left = least, left - 1
    return adjusted
