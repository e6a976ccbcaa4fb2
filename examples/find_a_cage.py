"""Find three fingers that an object cannot leave, and have the cage verified (Thesis 5.1).

python examples/find_a_cage.py -o cage.png
"""

import argparse
from pathlib import Path

import numpy as np

from expert.caging.synthesis import solve
from expert.drawing.cage import draw
from expert.problems.cage import CageProblem
from expert.verify.cage.check import verify
from expert.world.shape import Shape

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("cage.png"), help="picture")
output = parser.parse_args().output

boomerang = Shape(vertices=[[-0.06, 0.0], [0.0, 0.03], [0.06, 0.0], [0.0, 0.07]])
problem = CageProblem(shape=boomerang, pose=np.zeros(3), count=3)

cage = solve(problem, time_limit=30)
print(f"{cage.status} after {cage.seconds:.2f} s of processor time; fingers [m]:")
print(cage.fingers.round(4))
report = verify(problem, cage)
low, high = np.degrees(report.rotation_range)
print(f"the verifier says: {report.verdict}; the object turns from {low:.1f} to {high:.1f} deg at most")
draw(problem, cage, output)
print(f"picture in {output}")
