"""Hydra job: `python -m datasets.generate dataset=train|finetune|test|family|smoke seed=0 jobs=2`."""

import sys
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from datasets.entry import entry_point, swept
from datasets.generation import Generation, generate, versions


@entry_point("generate")
def main(cfg: DictConfig) -> None:
    """Make one data set and say where it is."""
    specification = instantiate(cfg.dataset, _convert_="object")
    out = Path(cfg.out or f"data/{specification.name}-seed{cfg.seed}")
    if apart := swept("dataset", "seed", "out"):
        out = out.with_name(f"{out.name},{apart}")
    now = versions()
    manifest = generate(
        Generation(
            specification=specification,
            seed=cfg.seed,
            out=out,
            jobs=cfg.jobs,
            backend=cfg.backend,
            overwrite=cfg.overwrite,
        )
    )
    failures = (
        ", ".join(f"{count} {reason}" for reason, count in manifest["failures"].items()) or "none failed"
    )
    print(f"{out}: {manifest['tasks']} tasks of {manifest['draws']} draws ({failures})")
    if manifest["versions"] != now:
        print("made by other versions of the code; overwrite=true makes it anew", file=sys.stderr)
    if refuted := manifest["failures"].get("unsound", 0):
        print(
            f"warning: the checker refuted {refuted} plans of the expert; see failed_draws in {out}/manifest.json",
            file=sys.stderr,
        )


if __name__ == "__main__":
    main()
