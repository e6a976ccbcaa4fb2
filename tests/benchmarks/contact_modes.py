"""Single steps of the simulator against all solutions that there are, found by trying every contact mode.

    python -m tests.benchmarks.contact_modes [--count 2000] [--seed 0]

Friction from 0 to 3.  Exits 1 where a step is none of the solutions, or has several and does not say so.
"""

import argparse
import sys
from collections import Counter

import numpy as np
from rich.progress import track

from tests.support.step_oracle import random_step, velocities
from tests.support.steps import simulated_step


def compare(rng: np.random.Generator) -> str:
    """How one random step went."""
    step = random_step(rng)
    found, (velocity, several, unchecked) = velocities(step), simulated_step(step)
    size = 1e-9 + max(np.abs(velocity).max(), np.abs(step.velocity).max())
    if not found:
        return "no solution by enumeration"
    if min(np.abs(velocity - v).max() for v in found) > 1e-6 * size:
        return "WRONG"
    different = max(np.abs(v - w).max() for v in found for w in found) > 1e-5 * size
    if different and not (several or unchecked):
        return "SEVERAL, NOT SAID"
    return "one of several, said" if different else "equal"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    outcomes = Counter(
        compare(np.random.default_rng([options.seed, k])) for k in track(range(options.count), "steps")
    )
    for outcome, count in sorted(outcomes.items()):
        print(f"{count:6d}  {outcome}")
    return 1 if any(outcome.isupper() or "no solution" in outcome for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
