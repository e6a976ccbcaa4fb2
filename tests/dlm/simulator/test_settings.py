"""One schema: what is refused, and what compiled code sees."""

from dataclasses import fields

import numpy as np
import pytest

from dlm.simulator import Execution, SimulatorSettings
from dlm.simulator.settings import MOST_SUBSTEPS, NUMBERS
from expert.errors import InvalidProblem

SWITCHES = ("material_point", "eased", "compensation", "rolling", "handover")
NOT_NUMBERS = [np.nan, "1", None, True, [1.0]]


def refused(kind: type, field: str, bad: object) -> str:
    """The one line that refuses a value of a field."""
    with pytest.raises(InvalidProblem) as caught:
        kind(**{field: bad})
    (line,) = str(caught.value).splitlines()
    return line


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        *(("approach", value) for value in (-0.1, 0.5, 0.6, np.inf, *NOT_NUMBERS)),
        *(("release", value) for value in (-0.1, 0.5, np.inf, *NOT_NUMBERS)),
        *(("lift_off", value) for value in (-1e-9, np.inf, *NOT_NUMBERS)),
        *(("parking", value) for value in (-1.0, np.inf, *NOT_NUMBERS)),
        *((name, value) for name in SWITCHES for value in (1, 0.0, "yes", None)),
    ],
)
def test_bad_execution_settings_are_refused_by_name(field, bad):
    line = refused(Execution, field, bad)
    assert line.startswith(f"execution.{field}: expected ")
    assert line.endswith(f"got {bad}")


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        *(("substeps", value) for value in (0, -20, 2.5, 20.0, np.inf, MOST_SUBSTEPS + 1, *NOT_NUMBERS)),
        *(("finger_radius", value) for value in (0.0, -1e-4, np.inf, *NOT_NUMBERS)),
        *(("damping", value) for value in (-1.0, np.inf, *NOT_NUMBERS)),
        *(("regularization", value) for value in (0.0, -1e-4, 1.0, np.inf, *NOT_NUMBERS)),
        *(("difference_step", value) for value in (0.0, -1e-4, np.inf, *NOT_NUMBERS)),
        *(("kappa", value) for value in (0.0, -np.inf, *NOT_NUMBERS)),
        *(("step_error", value) for value in (0.0, -2e-6, *NOT_NUMBERS)),
        *(("frictionless", value) for value in (1, "no", None)),
        *(("gradient", value) for value in ("magic", None, 1)),
        *(("execution", value) for value in (None, {})),
    ],
)
def test_bad_simulator_settings_are_refused_by_name(field, bad):
    line = refused(SimulatorSettings, field, bad)
    assert line.startswith(f"simulator.{field}: expected ")
    assert line.endswith(f"got {bad}")


def test_every_setting_has_a_limit():
    """The lists above name every field."""
    for kind, test in (
        (Execution, test_bad_execution_settings_are_refused_by_name),
        (SimulatorSettings, test_bad_simulator_settings_are_refused_by_name),
    ):
        (mark,) = test.pytestmark
        assert {field for field, _ in mark.args[1]} == {f.name for f in fields(kind)}


def test_the_ends_of_the_ranges_are_taken():
    Execution(approach=0, release=0.499, lift_off=0, parking=0.0)
    SimulatorSettings(substeps=1, damping=0, kappa=np.inf, step_error=np.inf, regularization=0.999)
    SimulatorSettings(substeps=np.int64(MOST_SUBSTEPS), kappa=np.float64(1), frictionless=np.bool_(True))


def test_compiled_code_sees_every_number_and_switch_under_its_own_name():
    settings = SimulatorSettings(substeps=7, kappa=3.0, execution=Execution(rolling=False, lift_off=0.25))
    seen = settings.numbers
    assert seen.dtype == NUMBERS
    for name in NUMBERS.names:
        owner = settings if hasattr(settings, name) else settings.execution
        assert seen[name] == getattr(owner, name), name
    assert set(NUMBERS.names) == {*vars(settings), *vars(settings.execution)} - {"gradient", "execution"}
