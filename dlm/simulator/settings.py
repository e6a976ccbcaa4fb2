"""How to simulate and how to execute a plan; every layer of the execution can be switched off by itself."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from expert.world.values import require

Gradient = Literal["finite_difference", "implicit"]


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
            value = getattr(self, name)
            require(0 <= value < 0.5, f"execution.{name}", "a fraction in [0, 0.5)", value)
        for name in ("lift_off", "parking"):
            value = getattr(self, name)
            require(0 <= value < np.inf, f"execution.{name}", "a length >= 0 in metres", value)


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
        for name, low, high, expected in (
            ("substeps", 1, np.inf, "at least 1"),
            ("finger_radius", TINY, np.inf, "a positive length in metres"),
            ("damping", 0, np.inf, "a number >= 0"),
            ("regularization", TINY, 1, "a share in (0, 1)"),
            ("difference_step", TINY, np.inf, "a positive length in metres"),
        ):
            value = getattr(self, name)
            require(low <= value < high, f"simulator.{name}", expected, value)
        for name, meaning in (("kappa", "rigid contact"), ("step_error", "steps that are never cut")):
            value = getattr(self, name)
            require(value > 0, f"simulator.{name}", f"a positive number, inf for {meaning}", value)
        methods = ("finite_difference", "implicit")
        require(self.gradient in methods, "simulator.gradient", " or ".join(methods), self.gradient)

    @property
    def numbers(self) -> Any:
        """All numbers and switches of both classes as one record of dtype NUMBERS, for compiled code."""
        parts = (self, self.execution)
        values = [getattr(part, name) for part in parts for name, _ in _numbers(type(part))]
        return np.array(tuple(values), NUMBERS)[()]


TINY = np.finfo(float).tiny


def _numbers(settings: type) -> list[tuple[str, Any]]:
    return [(f.name, f.type) for f in fields(settings) if f.type in (bool, int, float)]


NUMBERS = np.dtype(_numbers(SimulatorSettings) + _numbers(Execution), align=True)
