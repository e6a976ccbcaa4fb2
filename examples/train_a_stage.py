"""Train one stage of the thesis's architectures on a small data set, and try the policy out (Thesis 4.3, stage MDR).

python examples/train_a_stage.py -o trained [--iterations 20]
"""

import argparse
from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from datasets.entry import CONFIGS
from datasets.generation import Generation, generate
from dlm.execution import idle_action, simulate
from dlm.metrics import object_trajectory_loss
from dlm.simulator.settings import SimulatorSettings
from dlm.tasks import TaskBatch
from dlm.training.loop import Training

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("-o", "--output", type=Path, default=Path("trained"), help="folder of the data set")
parser.add_argument("--iterations", type=int, default=20, help="passes over the data")
options = parser.parse_args()

with initialize_config_dir(str(CONFIGS), version_base=None):
    data = compose("generate", overrides=["dataset=smoke"])
    cfg = compose("train", overrides=["stage=mdr", "schedule.learning_rate=0.001"])
folder = options.output / "data"
generate(Generation(specification=instantiate(data.dataset, _convert_="object"), seed=0, out=folder, jobs=1))
tasks = TaskBatch.read(folder)

stage = instantiate(cfg.stages.mdr, _convert_="object")
policy = instantiate(cfg.model, _convert_="object").build(stage.policy, instantiate(cfg.solver), seed=0)
policy.fit_centre(tasks)
training = Training(policy, stage.loss, tasks, instantiate(cfg.schedule))
losses = [training.iterate() for _ in range(options.iterations)]
print(
    f"loss on the mechanical parameters: {losses[0]:.3f}, after {options.iterations} iterations {losses[-1]:.3f}"
)

policy.eval()
for name, action in (("trained", policy(tasks.video)), ("doing nothing", idle_action(tasks))):
    motion = simulate(action, tasks, SimulatorSettings())
    print(f"{name}: object-trajectory loss {object_trajectory_loss(motion, tasks.poses).mean():.2f} cm^2")
