"""Why a task is infeasible, and whether what is said to mend it does."""

import numpy as np

from expert.contact import solve
from expert.problems.contact import ContactTask, Plan
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane


def lifted_block(friction: float, fingers: int) -> Plan:
    body, _ = Body.uniform([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]], 0.1)
    rise = np.column_stack([np.zeros(4), 0.05 + 0.01 * np.arange(4), np.zeros(4)])
    floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=0.5)
    return solve(
        ContactTask(
            body=body,
            environment=Environment(walls=(floor,)),
            trajectory=Trajectory.of(rise, 0.1),
            fingers=Fingers(count=fingers, friction=friction, max_force=1.0),
        )
    )


def test_what_would_mend_an_infeasible_task_is_told_and_does() -> None:
    """Two fingers of at most 1 N lift 0.981 N only with friction 0.4905 or more: 2 mu F >= m g."""
    plan = lifted_block(0.3, 2)
    assert plan.status == "infeasible"
    assert "step 0" in plan.reason
    assert "friction 0.49" in plan.reason
    assert lifted_block(0.3, 1).status == "infeasible"
    assert lifted_block(0.492, 2).found


def test_more_fingers_are_recommended_only_where_they_help() -> None:
    """One finger cannot lift; two can."""
    reason = lifted_block(0.492, 1).reason
    assert "2 fingers" in reason
    assert lifted_block(0.492, 2).found
