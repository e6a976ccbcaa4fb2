"""One schema: what is refused, and what compiled code sees."""

import numpy as np
import pytest

from dlm.simulator import Execution, SimulatorSettings
from dlm.simulator.settings import NUMBERS
from expert.errors import InvalidProblem


@pytest.mark.parametrize(
    ("field", "bad"),
    [("approach", 0.6), ("release", -0.1), ("lift_off", np.nan), ("parking", -1.0)],
)
def test_bad_execution_settings_are_refused_by_name(field, bad):
    with pytest.raises(InvalidProblem, match=f"execution.{field}"):
        Execution(**{field: bad})


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        ("substeps", 0),
        ("finger_radius", 0.0),
        ("kappa", np.nan),
        ("gradient", "magic"),
        ("damping", -1.0),
        ("step_error", 0.0),
    ],
)
def test_bad_simulator_settings_are_refused_by_name(field, bad):
    with pytest.raises(InvalidProblem, match=f"simulator.{field}"):
        SimulatorSettings(**{field: bad})


def test_compiled_code_sees_every_number_and_switch_under_its_own_name():
    settings = SimulatorSettings(substeps=7, kappa=3.0, execution=Execution(rolling=False, lift_off=0.25))
    seen = settings.numbers
    assert seen.dtype == NUMBERS
    for name in NUMBERS.names:
        owner = settings if hasattr(settings, name) else settings.execution
        assert seen[name] == getattr(owner, name), name
    assert set(NUMBERS.names) == {*vars(settings), *vars(settings.execution)} - {"gradient", "execution"}
