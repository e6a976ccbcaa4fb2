"""Train the architectures of Table 4.1: `python train.py stage=nn|nnm|mdr|cvx|dlm|all model=thesis seed=0`."""

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from datasets.entry import entry_point
from dlm.checkpoint import load, restore_weights
from dlm.evaluation.watch import watch
from dlm.models import Policy
from dlm.tasks import TaskBatch, read_all
from dlm.training import Stage, Training, fit


@entry_point("train")
def main(cfg: DictConfig) -> None:
    """Train the chosen stages, each after the one whose weights it starts from."""
    tasks = read_all(cfg.data)
    stages = [instantiate(node, _convert_="object") for node in cfg.stages.values()]
    for stage in stages:
        path = train_stage(cfg, stage, tasks)
        print(f"{stage.name}: {path}")
    print(f"curves: tensorboard --logdir {folder(cfg) / 'tensorboard'}")
    print(f"next: python evaluate.py output={cfg.output} seeds=[{cfg.seed}]")


def train_stage(cfg: DictConfig, stage: Stage, tasks: dict[str, TaskBatch]) -> Path:
    """One stage, from fresh weights or from those of its warm start; the checkpoint's path."""
    schedule = instantiate(cfg.schedule)
    model = instantiate(cfg.model, _convert_="object")
    policy = model.build(stage.policy, instantiate(cfg.solver), seed=cfg.seed)
    policy.fit_centre(tasks["train"])
    if stage.warm_start:
        start_from(cfg, stage.warm_start, policy, model.name)
    path = folder(cfg) / f"{stage.name}.safetensors"
    fit(
        Training(policy, stage.loss, tasks[stage.dataset], schedule),
        stage,
        path=path,
        model=model.name,
        settings=settings(cfg, stage),
        watch=watch(tasks, instantiate(cfg.watch, _convert_="object")),
        resume=cfg.resume,
    )
    return path


def start_from(cfg: DictConfig, earlier: str, policy: Policy, model: str) -> None:
    """Load the weights of an earlier stage."""
    path = folder(cfg) / f"{earlier}.safetensors"
    command = f"python train.py stage={earlier} model={model} seed={cfg.seed} output={cfg.output}"
    restore_weights(policy.weights(), load(path, command=command), name=model, source=path)


def folder(cfg: DictConfig) -> Path:
    """Where the checkpoints of one seed are."""
    return Path(cfg.output) / f"seed_{cfg.seed}"


def settings(cfg: DictConfig, stage: Stage) -> dict[str, object]:
    """All that a stage's steps depend on, as plain values; enough to rebuild the policy."""
    plain = OmegaConf.to_container(cfg, resolve=True)
    chosen = {key: plain[key] for key in ("model", "solver", "schedule", "seed")}
    return {**chosen, "stage": plain["stages"][stage.name]}


if __name__ == "__main__":
    main()
