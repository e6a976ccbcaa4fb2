"""Figures of the thesis that show plans and cages: solve, check and draw their problem files.

python examples/figures.py 3-6 5-15 -o pictures      (3-6, 3-8, 5-14, 5-15, 5-16, 5-17)
"""

import argparse
import sys
from pathlib import Path

from expert.__main__ import main as expert

PROBLEMS = Path(__file__).resolve().parent.parent / "configs/problem"
NAMED = ("t", "i", "m", "hourglass")
FIGURES = {
    "3-6": [
        "contact_trajectory/block_slide_one_finger",
        "contact_trajectory/block_pivot_two_fingers",
        "contact_trajectory/block_lift_two_fingers",
        "contact_trajectory/tool_slide_one_finger",
        "contact_trajectory/tool_pivot_one_finger_rough",  # friction 0.2: at the thesis's 0.1 it is impossible
        "contact_trajectory/triangle_pivot_two_fingers",
        "contact_trajectory/transverse_curved_push_one_finger",
        "contact_trajectory/transverse_rotation_two_fingers",
    ],
    "3-8": [
        "contact_trajectory/wall_push_pivot_lift_two_fingers",
        "contact_trajectory/transverse_wall_slide_pivot_two_fingers",
    ],
    "5-14": [f"cage/random_{k:02d}" for k in range(20)],
    "5-15": [f"cage/{name}_{limit}" for limit in ("wall", "grippers") for name in NAMED],
    "5-16": ["cage/hooks_3", "cage/hooks_4"],
    "5-17": [
        "cage/hourglass_min",
        "cage/m_min",
        "cage/hourglass_max",
        *(f"cage/{name}_tripod" for name in NAMED),
    ],
}

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("figures", nargs="*", choices=FIGURES, default=["3-6"], help="default: 3-6")
parser.add_argument(
    "-o", "--output", type=Path, default=Path("build"), help="folder of pictures and solutions"
)
options = parser.parse_args()
options.output.mkdir(parents=True, exist_ok=True)

for figure in options.figures:
    for name in FIGURES[figure]:
        print(f"== Fig. {figure}: {name}", flush=True)
        result = options.output / Path(name).name
        solve = ["solve", f"{PROBLEMS / name}.yaml", "-o", f"{result}.json"]
        for command in (
            solve,
            ["verify", f"{result}.json"],
            ["draw", f"{result}.json", "-o", f"{result}.png"],
        ):
            if code := expert(command):
                sys.exit(code)
