"""How to simulate and how to execute a plan; every layer of the execution can be switched off by itself."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args

import numpy as np

from expert.world.values import require

Gradient = Literal["finite_difference", "implicit"]
MOST_SUBSTEPS = 100_000
"""Per knot interval: states at all of them are kept."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, kw_only=True)
class Execution:
    """From a plan at the knots to finger commands at every substep.

    material_point: a finger in contact follows the object's surface along a constant-twist screw (else straight lines).
    eased: motions start and end at rest, by monotone cubic timing along the path (else constant speed between knots).
    compensation: commands lead the finger by force / stiffness, so that its spring exerts the planned force.
    approach, release: share of an interval by which a finger arrives early and by which it lets go late.
    lift_off [m]: bump along the facet normal on the way from and to a facet.
    parking [m]: least distance from the object at knots where the finger is not loaded; 0 leaves it where planned.
    rolling: correct the rolling of round fingers along the facet.
    handover: where a finger comes or goes, the others change their forces in step with its ramp, not ahead of it.
    """

    material_point: bool = True
    eased: bool = True
    compensation: bool = True
    approach: float = 0.4
    release: float = 0.4
    lift_off: float = 5e-3
    parking: float = 5e-3
    rolling: bool = True
    handover: bool = True

    def __post_init__(self) -> None:
        for name in ("approach", "release"):
            _require_number(self, f"execution.{name}", "a fraction in [0, 0.5)", 0, 0.5)
        for name in ("lift_off", "parking"):
            _require_number(self, f"execution.{name}", "a length >= 0 in metres", 0, np.inf)
        for name in ("material_point", "eased", "compensation", "rolling", "handover"):
            _require_switch(self, f"execution.{name}")


@dataclass(frozen=True, kw_only=True)
class SimulatorSettings:
    """Time stepping, contact smoothing and gradients.

    substeps: steps per knot interval.  step_error [m]: where a step's error is estimated to be larger, it is cut into parts;
    inf never does.  finger_radius [m].  damping: of the finger springs, as a share of the critical 2 sqrt(stiffness mass).
    regularization: contact compliance as a share of the diagonal of the LCP matrix.
    kappa [1/m]: contact activation min(1, 2 sigmoid(-kappa gap)) (Thesis 4-CT9); inf is rigid contact.
    frictionless: no friction at fingers and walls (the support plane keeps its own).
    gradient: `finite_difference` (central, position step `difference_step` [m]) or `implicit` (of the known active set).
    """

    substeps: int = 20
    step_error: float = 2e-6
    finger_radius: float = 1e-4
    damping: float = 1.0
    regularization: float = 1e-4
    kappa: float = np.inf
    frictionless: bool = False
    gradient: Gradient = "finite_difference"
    difference_step: float = 2e-4
    execution: Execution = field(default_factory=Execution)

    def __post_init__(self) -> None:
        whole = isinstance(self.substeps, int | np.integer) and not isinstance(self.substeps, bool)
        expected = f"a whole number of 1 to {MOST_SUBSTEPS}"
        require(whole and 1 <= self.substeps <= MOST_SUBSTEPS, "simulator.substeps", expected, self.substeps)
        for name, expected, low, high in (
            ("finger_radius", "a positive length in metres", TINY, np.inf),
            ("damping", "a number >= 0", 0, np.inf),
            ("regularization", "a share in (0, 1)", TINY, 1),
            ("difference_step", "a positive length in metres", TINY, np.inf),
            ("kappa", "a positive number, inf for rigid contact", TINY, None),
            ("step_error", "a positive number, inf for steps that are never cut", TINY, None),
        ):
            _require_number(self, f"simulator.{name}", expected, low, high)
        _require_switch(self, "simulator.frictionless")
        methods = get_args(Gradient)
        require(self.gradient in methods, "simulator.gradient", " or ".join(methods), self.gradient)
        fits = isinstance(self.execution, Execution)
        require(fits, "simulator.execution", "an Execution", self.execution)

    @property
    def numbers(self) -> Any:
        """All numbers and switches of both classes as one record of dtype NUMBERS, for compiled code."""
        parts = (self, self.execution)
        values = [getattr(part, name) for part in parts for name, _ in _numbers(type(part))]
        return np.array(tuple(values), NUMBERS)[()]


def _require_number(settings: object, field: str, expected: str, low: float, high: float | None) -> None:
    """A number in [low, high), or from low on, infinity included, where high is None."""
    value = getattr(settings, field.split(".")[1])
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    require(number and low <= value and (high is None or value < high), field, expected, value)


def _require_switch(settings: object, field: str) -> None:
    value = getattr(settings, field.split(".")[1])
    require(isinstance(value, bool | np.bool_), field, "true or false", value)


def _numbers(settings: type) -> list[tuple[str, Any]]:
    return [(f.name, f.type) for f in fields(settings) if f.type in (bool, int, float)]


NUMBERS = np.dtype(_numbers(SimulatorSettings) + _numbers(Execution), align=True)
