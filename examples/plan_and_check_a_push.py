"""Plan a push, and have the plan checked: one finger moves a block along the floor (Thesis 3.1, Fig. 3-6a).

python examples/plan_and_check_a_push.py -o push.png
"""

import argparse
from pathlib import Path

import numpy as np

from expert.contact import solve
from expert.drawing.contact_trajectory import draw
from expert.problems.contact import ContactTask, Robustness
from expert.verify.plan.check import check_plan
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("push.png"), help="picture or animation")
output = parser.parse_args().output

block, _ = Body.uniform([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]], mass=0.1)
floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=0.3)
x = 0.02 * np.arange(5)
task = ContactTask(
    body=block,
    environment=Environment(walls=(floor,)),
    trajectory=Trajectory.of(np.column_stack([x, np.full(5, 0.05), np.zeros(5)]), dt=0.1),
    fingers=Fingers(count=1, friction=0.5, max_force=10.0),
    robustness=Robustness(cone_fraction=0.7),
)

plan = solve(task)
print(f"{plan.status}: cost {plan.objective:.4f}, proved to be at least {plan.bound:.4f}")
for t, (position, force) in enumerate(zip(plan.positions[:, 0], plan.forces[:, 0], strict=True)):
    print(f"  step {t}: finger at {position.round(4)} m pushes with {force.round(3)} N")
print(f"the checker says: {check_plan(task, plan).verdict}")
draw(task, plan, output)
print(f"picture in {output}")
