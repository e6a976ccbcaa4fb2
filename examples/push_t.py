"""Push-T from 96 x 96 pixels, without a demonstration: the policy in anybody's loop.

python examples/push_t.py -o push_t.gif [--seed 3]
"""

import argparse

import gym_pusht  # noqa: F401  (registers the environment)
import gymnasium

from dlm.control import PushPolicy
from expert.drawing.canvas import save_frames

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", default="push_t.gif")
parser.add_argument("--seed", type=int, default=3)
options = parser.parse_args()

world = gymnasium.make(
    "gym_pusht/PushT-v0", obs_type="pixels", visualization_width=256, visualization_height=256
)
policy = PushPolicy.for_pusht(observation="pixels")
frame, _ = world.reset(seed=options.seed)
policy.reset()
film, done = [world.render()], False
while not done:
    frame, _, success, late, info = world.step(policy.select_action({"pixels": frame}))
    film.append(world.render())
    done = success or late
print(f"{'success' if success else 'failure'} after {len(film) - 1} steps, {info['coverage']:.1%} covered")
save_frames(film, options.output, rate=10)
