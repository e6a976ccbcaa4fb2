"""ContactTask -> mapping: problem files of `problem: contact_trajectory` for tasks that were not read from one."""

from typing import Any

from expert.problems.contact import ContactTask
from expert.world.walls import HalfPlane


def task_fields(task: ContactTask, *, description: str = "") -> dict[str, Any]:
    """The problem file of a task, as plain values: reading it gives the task back.

    Lengths and poses refer to the task's own body frame, whose origin is the centre of mass.
    """
    body, path = task.body, task.trajectory
    return {
        "schema": 1,
        "problem": "contact_trajectory",
        "description": description,
        "object": {
            "vertices": body.vertices.tolist(),
            "mass": body.mass,
            "com": [0.0, 0.0],
            "inertia": body.inertia,
        },
        "environment": {
            "plane": task.environment.plane,
            "gravity": task.environment.gravity,
            "walls": [_wall(wall) for wall in task.environment.walls],
            "support_friction": task.environment.support_friction,
        },
        "trajectory": {
            "dt": path.dt,
            "poses": path.poses.tolist(),
            "before": path.before.tolist(),
            "after": path.after.tolist(),
        },
        "fingers": {
            "count": task.fingers.count,
            "friction": task.fingers.friction,
            "max_force": task.fingers.max_force,
            "facet_margin": task.fingers.facet_margin,
            "clearance": task.fingers.clearance,
        },
        "cost": vars(task.cost).copy(),
        "robustness": vars(task.robustness).copy(),
    }


def _wall(wall: HalfPlane) -> dict[str, Any]:
    return {"point": wall.point.tolist(), "normal": wall.normal.tolist(), "friction": wall.friction}
