"""Compare the trained architectures: `python evaluate.py output=runs seeds=[0]` writes Table 4.1, figures 4-6 and 4-7, and a report.

`python evaluate.py experiment=table_4_1` does so for the five seeds that `python train.py experiment=table_4_1` trains.
"""

import json
import shlex
import sys
from pathlib import Path

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.console import Console

from datasets.entry import entry_point
from datasets.store import write_whole
from dlm.evaluation.baselines import unlearned
from dlm.evaluation.extras import read_extras
from dlm.evaluation.report import png
from dlm.evaluation.settle import settle
from dlm.evaluation.study import Study, Trained
from dlm.policy import Policy
from dlm.tasks import TaskBatch, read_all
from dlm.training.checkpoint import About, load, restore_weights
from dlm.training.stage import Stage
from expert.world.values import require

STAGES = ("nn", "nnm", "mdr", "cvx", "dlm")


@entry_point("evaluate")
def main(cfg: DictConfig) -> None:
    """Rebuild every policy from its checkpoint, execute its actions, write tables and report."""
    require(len(cfg.seeds) > 0, "seeds", "at least one seed", list(cfg.seeds), "seeds=[0]")
    known = ("running", "settled")
    require(cfg.batch_norm in known, "batch_norm", " or ".join(known), cfg.batch_norm)
    torch.set_num_threads(1)
    tasks, extras = read_all(cfg.data), read_extras(cfg.extras)
    study = Study(
        trained=[trained(cfg, name, tasks) for name in STAGES],
        tasks=tasks,
        simulator=instantiate(cfg.simulator, _convert_="object"),
        baselines=unlearned() if cfg.perceived else {},
    )
    with Console(stderr=True).status("simulating") as status:
        outcomes = study.outcomes()
        status.update("timing")
        table = study.table(outcomes, origin(cfg, {name: batch.fingerprint for name, batch in tasks.items()}))
        status.update("drawing")
        report = study.report(outcomes, table, examples=cfg.examples, extras=extras)
        page = report.html()
    folder = Path(cfg.results or cfg.output)
    files = {
        "table_4_1.md": table.as_markdown().encode(),
        "table_4_1.csv": table.as_csv().encode(),
        "table_4_1.json": json.dumps(table.as_json(), indent=1).encode(),
        "figure_4_6.png": png(report.curves),
        "figure_4_7.png": png(report.qualitative),
        "report.html": page.encode(),
    }
    for name, data in files.items():
        write_whole(folder / name, data)
    print(table.as_markdown())
    print(f"report: {(folder / 'report.html').resolve()}")


def trained(cfg: DictConfig, name: str, tasks: dict[str, TaskBatch]) -> Trained:
    """One architecture with the policies of all seeds."""
    loaded = [load_policy(Path(cfg.output), name, seed) for seed in cfg.seeds]
    if cfg.batch_norm == "settled":
        for stage, policy, _ in loaded:
            settle(policy, tasks[stage.dataset])
    return Trained(
        stage=loaded[0][0], policies=[policy for _, policy, _ in loaded], abouts=[a for *_, a in loaded]
    )


def load_policy(output: Path, name: str, seed: int) -> tuple[Stage, Policy, About]:
    """A policy as its checkpoint describes it, with its weights."""
    path = output / f"seed_{seed}" / f"{name}.safetensors"
    saved = load(path, command=f"python train.py stage={name} seed={seed} output={output}")
    about = saved.about
    require(
        about.stage == name, f"checkpoint {path}", f"stage {name}", f"stage {about.stage}", "train it again"
    )
    stage = instantiate(about.settings["stage"], _convert_="object")
    model = instantiate(about.settings["model"], _convert_="object")
    policy = model.build(stage.policy, instantiate(about.settings["solver"]), seed=seed)
    restore_weights(policy.weights(), saved, name=model.name, source=path)
    return stage, policy, about


def origin(cfg: DictConfig, data: dict[str, str]) -> dict[str, object]:
    """How the numbers came about."""
    command = shlex.join(["python", Path(sys.argv[0]).name, *sys.argv[1:]])
    return {"command": command, "seeds": list(cfg.seeds), "data (sha256)": data}


if __name__ == "__main__":
    main()
