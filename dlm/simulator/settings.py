"""How to simulate and how to execute a plan; every layer of the execution can be switched off by itself."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from expert.world.values import require

Gradient = Literal["finite_difference", "implicit"]


class Physics(NamedTuple):
    """What the time stepper needs of the settings."""

    substeps: int
    radius: float
    damping: float
    regularization: float
    kappa: float


class Layers(NamedTuple):
    """What the execution layer needs of the settings."""

    substeps: int
    radius: float
    screw: bool
    pchip: bool
    compensation: bool
    approach: float
    release: float
    lift_off: float
    parking: float
    rolling: bool
    handover: bool


@dataclass(frozen=True, kw_only=True)
class Execution:
    """From a plan at the knots to finger commands at every substep.

    material_point: a finger in contact follows the object's surface along a constant-twist screw (else straight lines).
    timing: motion law along the path; `pchip` starts and ends at rest, `linear` has constant speed between knots.
    compensation: commands lead the finger by force / stiffness, so that its spring exerts the planned force.
    approach, release: share of an interval by which a finger arrives early and by which it lets go late.
    lift_off [m]: bump along the facet normal on the way from and to a facet.
    parking [m]: least distance from the object at knots where the finger is not loaded; 0 leaves it where planned.
    rolling: correct the rolling of round fingers along the facet.
    handover: where a finger comes or goes, the others change their forces in step with its ramp, not ahead of it.
    """

    material_point: bool = True
    timing: Literal["pchip", "linear"] = "pchip"
    compensation: bool = True
    approach: float = 0.4
    release: float = 0.4
    lift_off: float = 5e-3
    parking: float = 5e-3
    rolling: bool = True
    handover: bool = True

    def __post_init__(self) -> None:
        require(self.timing in ("pchip", "linear"), "execution.timing", "pchip or linear", self.timing)
        for name in ("approach", "release"):
            value = getattr(self, name)
            require(0 <= value < 0.5, f"execution.{name}", "a fraction in [0, 0.5)", value)
        for name in ("lift_off", "parking"):
            value = getattr(self, name)
            require(0 <= value < np.inf, f"execution.{name}", "a length >= 0 in metres", value)


@dataclass(frozen=True, kw_only=True)
class SimulatorSettings:
    """Time stepping, contact smoothing and gradients.

    substeps: steps per knot interval.  finger_radius [m].  damping: of the finger springs [N s/m].
    regularization: contact compliance as a share of the diagonal of the LCP matrix.
    kappa [1/m]: contact activation min(1, 2 sigmoid(-kappa gap)) (Thesis 4-CT9); inf is rigid contact.
    frictionless: no friction at fingers and walls (the support plane keeps its own).
    gradient: `finite_difference` (central, position step `difference_step` [m]) or `implicit` (of the known active set).
    """

    substeps: int = 20
    finger_radius: float = 1e-4
    damping: float = 0.0
    regularization: float = 1e-4
    kappa: float = np.inf
    frictionless: bool = False
    gradient: Gradient = "finite_difference"
    difference_step: float = 2e-4
    execution: Execution = field(default_factory=Execution)

    def __post_init__(self) -> None:
        require(self.substeps >= 1, "simulator.substeps", "at least 1", self.substeps)
        radius, damping, step = self.finger_radius, self.damping, self.difference_step
        require(0 < radius < np.inf, "simulator.finger_radius", "a positive length in metres", radius)
        require(0 <= damping < np.inf, "simulator.damping", "a number >= 0", damping)
        require(
            0 < self.regularization < 1, "simulator.regularization", "a share in (0, 1)", self.regularization
        )
        require(self.kappa > 0, "simulator.kappa", "a positive number, inf for rigid contact", self.kappa)
        require(
            self.gradient in ("finite_difference", "implicit"),
            "simulator.gradient",
            "finite_difference or implicit",
            self.gradient,
        )
        require(0 < step < np.inf, "simulator.difference_step", "a positive length in metres", step)

    @property
    def physics(self) -> Physics:
        """The part that the time stepper compiles against."""
        return Physics(
            self.substeps, self.finger_radius, self.damping, self.regularization, float(self.kappa)
        )

    @property
    def layers(self) -> Layers:
        """The part that the execution layer compiles against."""
        e = self.execution
        return Layers(
            self.substeps,
            self.finger_radius,
            e.material_point,
            e.timing == "pchip",
            e.compensation,
            float(e.approach),
            float(e.release),
            float(e.lift_off),
            float(e.parking),
            e.rolling,
            e.handover,
        )
