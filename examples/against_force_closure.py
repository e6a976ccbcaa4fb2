"""The same starts, grasped with a certificate and by contacts chosen for their quality (Thesis, Fig. 5-31).

python examples/against_force_closure.py -o force_closure.png
"""

import argparse
from pathlib import Path

import numpy as np

from expert.drawing.canvas import new_figure, save_figure
from expert.drawing.grasp_figures import draw_errors, draw_poses
from expert.drawing.marks import legend
from expert.grasping.executions import force_closure_comparison
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem
from expert.world.named import named_shape
from expert.world.shape import Shape

RUNS, SHOWN = 100, 30

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("-o", "--output", type=Path, default=Path("force_closure.png"), help="picture")
output = parser.parse_args().output

task = GraspProblem(shape=Shape(vertices=named_shape("T")), pose=np.zeros(3))
answer = solve(task)
print(f"{answer.status} by {answer.method} after {answer.seconds:.1f} s")
starts, errors, ends = force_closure_comparison(task, answer, RUNS)

figure = new_figure(10, 5.2)
left, middle, right = figure.subfigures(1, 3, squeeze=False, width_ratios=(1, 1, 1.2))[0]
draw_poses(left.subplots(), task, starts[:SHOWN], np.empty((0, 2)), "starts")
for axes, (name, (poses, fingers)) in zip(middle.subplots(2, 1), ends.items(), strict=True):
    draw_poses(axes, task, poses[:SHOWN], fingers, f"ends: {name}")
    median, largest = 100 * np.median(errors[name]), 100 * errors[name].max()
    print(f"{name}: median error {median:.4f} %, largest {largest:.4f} % of the size")
draw_errors(right.subplots(), errors)
legend(figure, "starts", "goal", "finger")
save_figure(figure, output)
print(f"picture in {output}")
