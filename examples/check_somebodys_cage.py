"""Does an arrangement of fingers hold an object for good, or is there a way out?  A proof, or an escape (Thesis 5.1).

python examples/check_somebodys_cage.py -o way_out.gif
"""

import argparse
from pathlib import Path

import numpy as np

from expert.drawing.cage import draw
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify
from expert.world.shape import Shape

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("way_out.gif"), help="animation of the escape")
output = parser.parse_args().output

square = Shape(vertices=[[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
beside = np.array([[-0.055, 0.0], [0.0, -0.055], [0.055, 0.0], [0.0, 0.055]])

for name, fingers in (("four fingers", beside), ("three of them", beside[:3])):
    arrangement = Arrangement(shape=square, pose=np.zeros(3), fingers=fingers)
    report = verify(arrangement, None)
    print(f"{name}: {report.verdict}")
    if report.verdict == "caged":
        low, high = np.degrees(report.rotation_range)
        print(f"  the object turns from {low:.1f} to {high:.1f} deg at most")
    if report.verdict == "escapes":
        print(
            f"  a way out in {len(report.path) - 1} moves, each checked exactly, ends at {report.path[-1].round(3)}"
        )
        draw(arrangement, None, output)
        print(f"  animation in {output}")
