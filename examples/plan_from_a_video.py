"""From a video of a moving object to what two fingers have to do, tried out in the simulator (Thesis Ch. 4).

python examples/plan_from_a_video.py -o clip [--video clip.mp4 --scale 0.001]
"""

import argparse
import json
from pathlib import Path

from dlm.infer import Given, infer
from dlm.infer.drawing import draw_inference

HERE = Path(__file__).resolve().parent
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("clip"), help="folder of the results")
parser.add_argument("--video", type=Path, default=HERE.parent / "docs/examples/pivot_lift.mp4")
parser.add_argument("--scale", type=float, default=0.001, help="metres per pixel")
options = parser.parse_args()

answer = infer(options.video, Given(scale=options.scale, mass=0.1, friction=0.5))
print(f"{answer.status} {answer.reason}".strip())
options.output.mkdir(parents=True, exist_ok=True)
draw_inference(answer, options.output / "motion.gif")
if answer.plan is not None and answer.result is not None:
    millimetres, degrees = answer.result.final_error
    print(
        f"executed in the simulator, the object ends {millimetres:.3f} mm and {degrees:.3f} deg from where it should"
    )
    (options.output / "actions.json").write_text(json.dumps(answer.solution()))
    print(f"next: python -m expert verify {options.output / 'actions.json'}")
print(f"animation in {options.output / 'motion.gif'}")
