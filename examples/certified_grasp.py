"""Finger paths that bring an object from every start of a set into one grasp, without looking (Thesis 5.2).

python examples/certified_grasp.py -o grasp.png
"""

import argparse
from pathlib import Path

import numpy as np

from expert.drawing.certified_grasp import draw
from expert.grasping.executions import executions
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem
from expert.verify.grasp.check import verify
from expert.world.shape import Shape

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("grasp.png"), help="picture or animation")
output = parser.parse_args().output

wedge = Shape(vertices=[[-0.05, -0.03], [0.06, -0.04], [0.04, 0.05], [-0.04, 0.04]])
problem = GraspProblem(shape=wedge, pose=np.zeros(3))

grasp = solve(problem, time_limit=60)
print(f"{grasp.status} by {grasp.method} after {grasp.seconds:.2f} s")
print(verify(problem, grasp))

runs = executions(problem, grasp, 100)
print(f"{int(runs.arrived(problem.pose, wedge.size).sum())} of 100 executions end at the goal")
draw(problem, grasp, output)
print(f"picture in {output}")
