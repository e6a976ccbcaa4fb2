"""Executions of a grasp from random starts, and how far they end from the goal; against contacts chosen for their quality."""

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array
from expert.grasping.force_closure import best_grasp, least_distance
from expert.grasping.sweeping import Sweep, sweep
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet

REACH = 0.2
"""A force-closure grasp is chosen among contacts that can be reached from this distance, over the object's diameter."""


def start_set(task: GraspProblem, answer: GraspSolution) -> StartSet:
    """The verified starts."""
    return StartSet(FingerPath(task.shape, task.pose, answer.path))


def executions(task: GraspProblem, answer: GraspSolution, count: int) -> Sweep:
    """Executions from random verified starts, the same ones each time.

    Raises InvalidProblem where the fingers do not cage the goal at the first knot, so that there are no such starts.
    """
    cage = start_set(task, answer)
    if not cage.bounded:
        raise InvalidProblem(
            "path", expected="fingers that cage the goal at the first knot", got="others", remedy="verify it"
        )
    starts = cage.starts(np.random.default_rng(0), count)
    return sweep(task.shape, answer.path, starts, goal=task.pose)


def pose_errors(task: GraspProblem, ends: Array) -> Array:
    """|dx| + |dy| + r |dtheta| over the object's size, r its radius of gyration, of poses (M, 3)."""
    plate = mass_properties(task.shape.vertices)
    gyration = float(np.sqrt(plate.second_moment / plate.area))
    return np.asarray(np.abs(ends - task.pose) @ np.array([1, 1, gyration]) / task.shape.size)


def force_closure_comparison(
    task: GraspProblem, answer: GraspSolution, count: int
) -> tuple[Array, dict[str, Array], dict[str, tuple[Array, Array]]]:
    """Starts (M, 3); by strategy the errors of the end poses (M,) over the object's size, and end poses with fingers (Fig. 5-31)."""
    certified = executions(task, answer, count)
    starts = certified.poses[:, 0]
    grasp = best_grasp(task.shape, REACH * task.shape.size)
    path = grasp.approach(task.pose, least_distance(task.shape, grasp, task.pose, starts))
    naive = sweep(task.shape, path, starts, goal=task.pose)
    runs = {"force closure": (naive, path[-1]), "certified": (certified, answer.path[-1])}
    errors = {name: pose_errors(task, run.ends) for name, (run, _) in runs.items()}
    return starts, errors, {name: (run.ends, fingers) for name, (run, fingers) in runs.items()}
