"""Plan, learn and certify how point fingers move a polygon in the plane: one import for scripts and notebooks.

    import certmanip

    cage = certmanip.cage(object=certmanip.outline("part.svg", size=0.1), fingers={"count": 4}).solve()
    print(cage.status, cage.verify().verdict)

A thin face over `expert`, `datasets` and `dlm`: names are looked up when they are first used, so that importing it is quick
and planning needs no learning library.  docs/how-to/python.md shows how to use it.
"""

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from certmanip.cases import Case, cage, case, certified_grasp, contact_trajectory, load, push
    from certmanip.installation import IncompleteInstallation
    from certmanip.outlines import outline
    from certmanip.video import infer
    from expert.errors import ExpertError, InvalidProblem, OutOfTime, SolverFailed
    from expert.problems.cage import Arrangement, CageProblem
    from expert.problems.contact import ContactTask, Cost, Robustness
    from expert.problems.grasp import GraspProblem
    from expert.problems.push import PushProblem
    from expert.shipped import problem_names
    from expert.world.environment import Environment
    from expert.world.fingers import Fingers, Gripper
    from expert.world.motion import Trajectory
    from expert.world.named import named_shape
    from expert.world.shape import Body, Shape
    from expert.world.walls import HalfPlane, Obstacle, Segment

_MODULES = {
    "certmanip.cases": ("Case", "cage", "case", "certified_grasp", "contact_trajectory", "load", "push"),
    "certmanip.installation": ("IncompleteInstallation",),
    "certmanip.outlines": ("outline",),
    "certmanip.video": ("infer",),
    "expert.errors": ("ExpertError", "InvalidProblem", "OutOfTime", "SolverFailed"),
    "expert.problems.cage": ("Arrangement", "CageProblem"),
    "expert.problems.contact": ("ContactTask", "Cost", "Robustness"),
    "expert.problems.grasp": ("GraspProblem",),
    "expert.problems.push": ("PushProblem",),
    "expert.shipped": ("problem_names",),
    "expert.world.environment": ("Environment",),
    "expert.world.fingers": ("Fingers", "Gripper"),
    "expert.world.motion": ("Trajectory",),
    "expert.world.named": ("named_shape",),
    "expert.world.shape": ("Body", "Shape"),
    "expert.world.walls": ("HalfPlane", "Obstacle", "Segment"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "Arrangement",
    "Body",
    "CageProblem",
    "Case",
    "ContactTask",
    "Cost",
    "Environment",
    "ExpertError",
    "Fingers",
    "GraspProblem",
    "Gripper",
    "HalfPlane",
    "IncompleteInstallation",
    "InvalidProblem",
    "Obstacle",
    "OutOfTime",
    "PushProblem",
    "Robustness",
    "Segment",
    "Shape",
    "SolverFailed",
    "Trajectory",
    "cage",
    "case",
    "certified_grasp",
    "contact_trajectory",
    "infer",
    "load",
    "named_shape",
    "outline",
    "problem_names",
    "push",
]


def __getattr__(name: str) -> Any:
    """The public name, imported when it is first asked for."""
    if name == "__version__":
        return metadata.version("certified-manipulation")
    if name not in _HOMES:
        raise AttributeError(f"module 'certmanip' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
