"""Single steps against a second statement of them, solved by trying every contact mode."""

import numpy as np

from tests.benchmarks.contact_modes import compare
from tests.support.step_oracle import free, random_step
from tests.support.steps import simulated_step


def test_random_steps_are_solutions_and_say_where_there_are_several():
    outcomes = [compare(np.random.default_rng([7, k])) for k in range(150)]
    assert set(outcomes) <= {"equal", "one of several, said"}
    assert outcomes.count("equal") > 100


def test_contacts_act_in_most_of_these_steps():
    steps = [random_step(np.random.default_rng([7, k])) for k in range(40)]
    acted = [np.abs(simulated_step(s)[0] - free(s)).max() > 1e-6 for s in steps]
    assert sum(acted) > 25
