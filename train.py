"""Train the architectures of Table 4.1: `python train.py stage=nn|nnm|mdr|cvx|dlm|all model=thesis seed=0`.

`python train.py experiment=table_4_1` trains all of them on five seeds, in two processes.
"""

import copy
from functools import partial
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from datasets.entry import entry_point, listed, swept
from dlm.evaluation.watch import watch
from dlm.tasks import read_all
from dlm.training.orchestrate import Run, seed_folder, train

build = partial(instantiate, _convert_="object")


@entry_point("train")
def main(cfg: DictConfig) -> None:
    """Train the chosen stages on the chosen seeds, each after the one whose weights it starts from."""
    seeds = listed(cfg.seed if cfg.seeds is None else cfg.seeds, "seeds", "seeds=[0,1,2]")
    output = Path(cfg.output) / swept("seed", "stage", "output")
    runs = [run_of(cfg, seed, output) for seed in seeds]
    for line in train(runs, jobs=cfg.jobs):
        print(line, flush=True)
    data, stages = HydraConfig.get().runtime.choices["data"], ",".join(cfg.stages)
    print(f"curves: tensorboard --logdir {runs[0].folder / 'tensorboard' if len(runs) == 1 else output}")
    print(
        f"next: python evaluate.py output={output} seeds=[{','.join(map(str, seeds))}] stages=[{stages}] data={data}"
    )


def run_of(cfg: DictConfig, seed: int, output: Path) -> Run:
    """The stages of one seed."""
    own = copy.deepcopy(cfg)
    own.seed = seed
    plain: dict[str, Any] = OmegaConf.to_container(own, resolve=True)  # type: ignore[assignment]
    return Run(
        seed=seed,
        stages=[build(stage) for stage in plain["stages"].values()],
        model=build(plain["model"]),
        program=partial(build, plain["solver"]),
        schedule=build(plain["schedule"]),
        read=partial(read_all, plain["data"], train_tasks=own.train_tasks),
        watch=partial(watch, simulator=build(plain["watch"])),
        folder=seed_folder(output, seed),
        settings={
            key: plain[key] for key in ("model", "solver", "schedule", "seed", "train_tasks", "stages")
        },
        threads=own.threads,
        resume=own.resume,
    )


if __name__ == "__main__":
    main()
