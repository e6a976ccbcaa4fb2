"""Compare the trained architectures: `python evaluate.py output=runs seeds=[0]` writes Table 4.1, figures 4-6 and 4-7, and a report.

`python evaluate.py experiment=table_4_1` does so for the five seeds that `python train.py experiment=table_4_1` trains.
"""

import shlex
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.console import Console

from datasets.entry import entry_point, listed, swept
from datasets.limits import Number
from dlm.evaluation.baselines import unlearned
from dlm.evaluation.extras import read_extras
from dlm.evaluation.report import FILES
from dlm.evaluation.study import Study
from dlm.evaluation.trained import read_trained
from dlm.tasks import first, read_all
from expert.files.output import Output, folder
from expert.world.values import require

build = partial(instantiate, _convert_="object")


@entry_point("evaluate")
def main(cfg: DictConfig) -> None:
    """Rebuild every policy from its checkpoint, execute its actions, write tables and report."""
    seeds = listed(cfg.seeds, "seeds", "seeds=[0]")
    stages = listed(cfg.stages, "stages", "stages=[nn,nnm,mdr,cvx,dlm]")
    films = Number(whole=True, least=0)
    require(films.holds(cfg.examples), "examples", str(films), cfg.examples)
    known = ("running", "settled")
    require(cfg.batch_norm in known, "batch_norm", " or ".join(known), cfg.batch_norm)
    torch.set_num_threads(1)
    every, extras = read_all(cfg.data), read_extras(cfg.extras)
    tasks = first(every, cfg.tasks)
    trained = [read_trained(cfg.output, stage, seeds, build) for stage in stages]
    study = Study(
        trained=[one.settled(every) for one in trained] if cfg.batch_norm == "settled" else trained,
        tasks=tasks,
        simulator=build(cfg.simulator),
        baselines=unlearned() if cfg.perceived else {},
    )
    command = shlex.join(["python", Path(sys.argv[0]).name, *sys.argv[1:]])
    data = {name: batch.fingerprint for name, batch in tasks.items()}
    origin = {"command": command, "seeds": seeds, "data (sha256)": data}
    with ExitStack() as stack:
        place = stack.enter_context(folder(Path(cfg.results or cfg.output) / swept("results", "output")))
        outputs = {name: stack.enter_context(Output(place / name)) for name in FILES}
        stack.enter_context(Console(stderr=True).status("simulating, timing, drawing"))
        outcomes = study.outcomes()
        table = study.table(outcomes, origin)
        files = study.report(outcomes, table, examples=cfg.examples, extras=extras).files()
        for name, content in files.items():
            outputs[name].deliver(content)
    print(table.as_markdown())
    print(f"report: {(place / 'report.html').resolve()}")


if __name__ == "__main__":
    main()
