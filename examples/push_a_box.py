"""Push a box past a post with one finger, have the plan checked, and draw it.

python examples/push_a_box.py -o box.png
"""

import argparse
from pathlib import Path

import numpy as np

from expert.drawing.push import draw
from expert.problems.push import Finger, LimitSurface, PushProblem
from expert.pushing.synthesis import solve
from expert.verify.push.check import verify
from expert.world.shape import Shape
from expert.world.walls import Obstacle

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("box.png"), help="picture, or .gif")
output = parser.parse_args().output

problem = PushProblem(
    shape=Shape(vertices=[[-0.04, -0.025], [0.04, -0.025], [0.04, 0.025], [-0.04, 0.025]]),
    start=np.zeros(3),
    goal=np.array([0.2, 0.02, 0.8]),
    limit_surface=LimitSurface(kind="ellipsoid", c=0.025),
    finger=Finger(start=np.array([-0.1, 0.0]), radius=0.008, friction=0.2),
    obstacles=(Obstacle(vertices=[[0.09, -0.01], [0.11, -0.01], [0.11, 0.01], [0.09, 0.01]]),),
    workspace=np.array([-0.15, -0.15, 0.3, 0.15]),
)

plan = solve(problem, time_limit=60)
print(
    f"{plan.status} after {plan.seconds:.1f} s of processor time: {len(plan.pushes)} pushes, {plan.objective:.1f} s"
)
report = verify(problem, plan)
print(f"the checker says: {report.verdict}")
for k, end in enumerate(report.ends):
    print(
        f"after push {k} the box is at ({end[0]:.4f}, {end[1]:.4f}) m, turned by {np.degrees(end[2]):.1f} deg"
    )
draw(problem, plan, output)
print(f"picture in {output}")
