"""Train the architectures of Table 4.1: `python train.py stage=nn|nnm|mdr|cvx|dlm|all model=thesis seed=0`.

`python train.py experiment=table_4_1` trains all of them on five seeds, in two processes.
"""

import copy
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from datasets.entry import entry_point
from dlm.evaluation.watch import watch
from dlm.policy import Policy
from dlm.tasks import TaskBatch, read_all
from dlm.training.checkpoint import load, read_about, restore_weights
from dlm.training.loop import Training, fit
from dlm.training.parallel import chains, run_side_by_side
from dlm.training.stage import Stage
from expert.errors import InvalidProblem
from expert.world.values import require


@entry_point("train")
def main(cfg: DictConfig) -> None:
    """Train the chosen stages on the chosen seeds, each after the one whose weights it starts from."""
    seeds = [cfg.seed] if cfg.seeds is None else list(cfg.seeds)
    require(len(seeds) > 0, "seeds", "at least one seed", seeds, "seeds=[0,1,2]")
    require(isinstance(cfg.jobs, int) and cfg.jobs >= 1, "jobs", "a number of processes", cfg.jobs)
    runs = [of_seed(cfg, seed) for seed in seeds]
    stages = list(stages_of(cfg).values())
    tasks = read_tasks(cfg)
    if cfg.jobs == 1:
        for run in runs:
            for stage in stages:
                print(train_stage(run, stage, tasks))
    else:
        train_side_by_side(cfg, runs, stages)
    print(f"curves: tensorboard --logdir {folder(runs[0]) / 'tensorboard' if len(runs) == 1 else cfg.output}")
    print(f"next: {following(cfg, seeds)}")


def following(cfg: DictConfig, seeds: Sequence[int]) -> str:
    """The command that judges what was trained."""
    if cfg.model.name == "structured":
        return f"python -m tests.benchmarks.stages --output {cfg.output} --seed {seeds[0]}"
    return f"python evaluate.py output={cfg.output} seeds=[{','.join(map(str, seeds))}]"


def of_seed(cfg: DictConfig, seed: int) -> DictConfig:
    """The configuration with one seed."""
    one = copy.deepcopy(cfg)
    one.seed = seed
    return one


def stages_of(cfg: DictConfig) -> dict[str, Stage]:
    """The stages to train, by name, in order."""
    return {name: instantiate(node, _convert_="object") for name, node in cfg.stages.items()}


def read_tasks(cfg: DictConfig) -> dict[str, TaskBatch]:
    """All data sets; of the training set the first `train_tasks`, if that is a number."""
    return read_all(cfg.data, train_tasks=cfg.train_tasks)


def train_side_by_side(cfg: DictConfig, runs: Sequence[DictConfig], stages: Sequence[Stage]) -> None:
    """Train several stages of several seeds at a time, the longest chains of stages first."""
    rows = [(run, chain) for chain in chains(stages) for run in runs]
    calls = [partial(train_chain, run, [stage.name for stage in chain]) for run, chain in rows]
    total = len(runs) * len(stages) * cfg.schedule.iterations
    done = partial(iterations_done, runs, stages, time.time())
    try:
        for line in run_side_by_side(calls, jobs=cfg.jobs, progress=done, total=total):
            print(line, flush=True)
    except KeyboardInterrupt:
        print(
            f"interrupted after {done()} of {total} iterations; the same command with resume=true goes on",
            file=sys.stderr,
        )
        raise


def train_chain(cfg: DictConfig, names: Sequence[str]) -> list[str]:
    """Stages of one seed in order, in a process of their own."""
    tasks, stages = read_tasks(cfg), stages_of(cfg)
    return [train_stage(cfg, stages[name], tasks) for name in names]


def train_stage(cfg: DictConfig, stage: Stage, tasks: dict[str, TaskBatch]) -> str:
    """One stage, from fresh weights or from those of its warm start; a line that says where it is."""
    torch.set_num_threads(cfg.threads)
    schedule = replace(instantiate(cfg.schedule), **stage.schedule)
    model = instantiate(cfg.model, _convert_="object")
    policy = model.build(stage.policy, instantiate(cfg.solver), seed=cfg.seed)
    policy.fit_centre(tasks["train"])
    if stage.warm_start:
        start_from(cfg, stage.warm_start, policy, model.name)
    path = checkpoint(cfg, stage)
    training = Training(policy, stage.loss, tasks[stage.dataset], schedule)
    fit(
        training,
        stage,
        path=path,
        model=model.name,
        settings=settings(cfg, stage),
        watch=watch(tasks, instantiate(cfg.watch, _convert_="object")),
        resume=cfg.resume,
    )
    return f"{stage.name}: {path} ({training.seconds:.0f} s of processor time)"


def start_from(cfg: DictConfig, earlier: str, policy: Policy, model: str) -> None:
    """Load the weights of an earlier stage."""
    path = folder(cfg) / f"{earlier}.safetensors"
    command = f"python train.py stage={earlier} model={model} seed={cfg.seed} output={cfg.output}"
    restore_weights(policy.weights(), load(path, command=command), name=model, source=path)


def folder(cfg: DictConfig) -> Path:
    """Where the checkpoints of one seed are."""
    return Path(cfg.output) / f"seed_{cfg.seed}"


def checkpoint(cfg: DictConfig, stage: Stage) -> Path:
    """Where the checkpoint of one stage of one seed is."""
    return folder(cfg) / f"{stage.name}.safetensors"


def iterations_done(runs: Sequence[DictConfig], stages: Sequence[Stage], start: float) -> int:
    """Iterations in the checkpoints of all runs; those written before `start` count only if they are gone on from."""
    done = 0
    for path in (checkpoint(run, stage) for run in runs for stage in stages):
        try:
            if runs[0].resume or path.stat().st_mtime >= start:
                done += read_about(path, command="").iteration
        except (FileNotFoundError, InvalidProblem):
            continue  # not begun, or about to be refused by the worker
    return done


def settings(cfg: DictConfig, stage: Stage) -> dict[str, object]:
    """All that a stage's steps depend on, as plain values; enough to rebuild the policy."""
    plain = OmegaConf.to_container(cfg, resolve=True)
    chosen = {key: plain[key] for key in ("model", "solver", "schedule", "seed", "train_tasks")}
    return {**chosen, "stage": plain["stages"][stage.name]}


if __name__ == "__main__":
    main()
