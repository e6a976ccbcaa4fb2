"""Trained policies, rebuilt from what their checkpoints say."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dlm.evaluation.settle import settle
from dlm.policy import Policy
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import About, load, restore_weights
from dlm.training.orchestrate import checkpoint_path, seed_folder
from dlm.training.stage import Stage
from expert.world.values import require

Build = Callable[[Any], Any]
"""An object from the plain values in which a checkpoint's settings describe it."""


@dataclass(frozen=True, kw_only=True)
class Trained:
    """One architecture, trained: its stage, and policy and record of every seed."""

    stage: Stage
    policies: Sequence[Policy]
    abouts: Sequence[About]

    @property
    def title(self) -> str:
        """As in the table."""
        return title_of(self.stage.name)

    def settled(self, tasks: Mapping[str, TaskBatch]) -> "Trained":
        """Batch norm's statistics taken anew, over the tasks that the stage learned from."""
        for policy in self.policies:
            settle(policy, tasks[self.stage.dataset])
        return self


def title_of(stage: str) -> str:
    """What a stage is called: NN for nn, CVX longer for cvx_longer."""
    name, _, variant = stage.partition("_")
    return " ".join(filter(None, (name.upper(), variant.replace("_", " "))))


def read_trained(output: str | Path, stage: str, seeds: Sequence[int], build: Build) -> Trained:
    """A stage with the policies of all seeds.  Raises InvalidProblem for a checkpoint that is missing, damaged, or another's."""
    found = [_read(Path(output), stage, seed, build) for seed in seeds]
    return Trained(
        stage=found[0][0], policies=[policy for _, policy, _ in found], abouts=[a for *_, a in found]
    )


def _read(output: Path, name: str, seed: int, build: Build) -> tuple[Stage, Policy, About]:
    """A policy as its checkpoint describes it, with its weights."""
    path = checkpoint_path(seed_folder(output, seed), name)
    saved = load(path, command=f"python train.py stage={name} seed={seed} output={output}")
    about = saved.about
    require(
        about.stage == name, f"checkpoint {path}", f"stage {name}", f"stage {about.stage}", "train it again"
    )
    stage, model, program = (build(about.settings[key]) for key in ("stage", "model", "solver"))
    policy = model.build(stage.policy, program, seed=seed)
    restore_weights(policy.weights(), saved, name=model.name, source=path)
    return stage, policy, about
