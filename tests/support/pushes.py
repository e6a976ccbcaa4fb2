"""Problems of pushing, and a plan made by hand."""

import numpy as np

from expert.problems.push import Finger, LimitSurface, Push, PushPlan, PushProblem, duration
from expert.world.shape import Shape

SQUARE = Shape(vertices=[[-0.04, -0.04], [0.04, -0.04], [0.04, 0.04], [-0.04, 0.04]])
TEE = Shape(vertices=0.01 * np.array([[-1, -5], [1, -5], [1, 1], [5, 1], [5, 3], [-5, 3], [-5, 1], [-1, 1]]))
ELLIPSOID = LimitSurface(kind="ellipsoid", c=0.03)


def square_problem(**changes) -> PushProblem:
    """A square goes 0.1 m to the right: one push through its middle."""
    stated = {
        "shape": SQUARE,
        "start": np.zeros(3),
        "goal": np.array([0.1, 0, 0]),
        "finger": Finger(start=np.array([-0.1, 0]), radius=0.01, friction=0.3),
        "limit_surface": ELLIPSOID,
    }
    return PushProblem(**{**stated, **changes})


def straight_push(way=((-0.06, 0.0),), end=(0.05, 0.0), pose=(0.1, 0, 0)) -> PushPlan:
    """The push that `square_problem` asks for, or a false one."""
    pushes = (Push(way=np.array(way), end=np.array(end), pose=np.array(pose)),)
    return PushPlan(status="solved", pushes=pushes, objective=duration(square_problem().finger, pushes))
