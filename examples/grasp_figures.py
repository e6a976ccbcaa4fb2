"""Figures of the thesis that show certified grasps: starts, executions on top of each other, sets of starts by method.

python examples/grasp_figures.py 5-28 -o random_polygons.png      (5-28, 5-29, 5-30)
"""

import argparse
from dataclasses import replace
from pathlib import Path

from expert.drawing.canvas import new_figure, save_figure, square_axes
from expert.drawing.certified_grasp import draw_moment, draw_starts
from expert.drawing.grasp_figures import draw_start_set
from expert.drawing.marks import LABEL, legend
from expert.files import read_problem
from expert.geometry.polygon import mass_properties
from expert.grasping.executions import executions, start_set
from expert.grasping.synthesis import solve

PROBLEMS = Path(__file__).resolve().parent.parent / "configs/problem/certified_grasp"
RUNS, KNOTS = 60, 5
FIGURES = {  # problems in rows, panels of each, and what the legend names
    "5-28": ([[f"random_{k:02d}" for k in range(i, i + 4)] for i in (0, 4, 8)], 1,
             ("starts", "goal", "finger at the start", "finger at the end", "finger path")),
    "5-29": ([["t"], ["hourglass"], ["m"], ["i"]], KNOTS, ("executions", "goal", "finger")),
    "5-30": ([["t_miqp1", "t_miqp2", "t"], ["hourglass_miqp1", "hourglass_miqp2", "hourglass"]], 1,
             ("goal", "set of starts", "finger at the start")),
}  # fmt: skip

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("figure", nargs="?", choices=FIGURES, default="5-28", help="default: 5-28")
parser.add_argument("-o", "--output", type=Path, default=Path("random_polygons.png"), help="picture")
options = parser.parse_args()
rows, panels, names = FIGURES[options.figure]
figure = new_figure(2.8 * panels * len(rows[0]), 3.0 * len(rows))
grid = figure.subplots(len(rows), panels * len(rows[0]))
for i, row in enumerate(rows):
    for j, name in enumerate(row):
        problem = read_problem(PROBLEMS / f"{name}.yaml")
        cost = "acceleration" if problem.options["method"] == "miqp1" else "attraction"
        task = replace(problem.task, cost=cost)
        answer = solve(task, **problem.options)
        print(f"{name}: {answer.status} by {answer.method} after {answer.seconds:.1f} s", flush=True)
        axes, caption = grid[i, panels * j], f"{name}: {answer.status}"
        if options.figure == "5-30" and len(answer.path):
            share = start_set(task, answer).area / mass_properties(task.shape.vertices).area
            draw_start_set(axes, task, answer)
            caption += f"\nstarts: {100 * share:.2f} % of the object"
        elif answer.found:
            runs = executions(task, answer, RUNS)
            if panels == 1:
                draw_starts(axes, task, answer, runs)
                square_axes(axes)
                arrived = sum(runs.arrived(task.pose, task.shape.size))
                caption = f"{name}: {arrived} of {RUNS} starts end at the goal"
            for k in range(panels if panels > 1 else 0):
                draw_moment(grid[i, k], task, answer, runs, float(k))
                square_axes(grid[i, k])
        axes.set_title(caption, fontsize=LABEL)
legend(figure, *names)
save_figure(figure, options.output)
