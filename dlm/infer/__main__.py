"""Command line: `python -m dlm.infer video=clip.mp4 scale=0.001` or `object_size=0.08`; configs/infer.yaml lists all options.

Exit codes: 0 planned; 4 no plan found; 2 bad input; 130 interrupted.
"""

import sys
from dataclasses import fields
from pathlib import Path

from omegaconf import DictConfig
from rich.console import Console

from datasets.entry import entry_point
from dlm.infer.clip import VideoFile
from dlm.infer.drawing import draw_inference
from dlm.infer.inference import Given, Inference, infer
from dlm.infer.segmentation import Segmentation
from dlm.structured import StructuredModel
from dlm.structured.weights import SHIPPED, trained_model
from expert.files.document import save
from expert.world.values import require

NO_PLAN = 4
NUMBERS = (
    *("scale", "object_size", "floor", "mass", "friction", "duration"),
    *("start", "end", "rate", "tolerance"),
)


@entry_point("infer")
def main(cfg: DictConfig) -> None:
    """Perceive, plan, simulate; write actions and animation."""
    for name in NUMBERS:
        require(cfg[name] is None or isinstance(cfg[name], int | float), name, "a number", cfg[name])
    folder = Path(cfg.out or Path("outputs") / "infer" / Path(cfg.video).stem)
    require(not folder.exists() or folder.is_dir(), "out", "a folder", f"{folder}, a file")
    with Console(stderr=True).status("perceiving and planning") as status:
        answer = infer(
            VideoFile(path=cfg.video, start=cfg.start, end=cfg.end, rate=cfg.rate),
            Given(**{field.name: cfg[field.name] for field in fields(Given)}),
            segmentation=Segmentation(
                colour=cfg.colour if cfg.colour is None else tuple(cfg.colour),
                background=cfg.background,
                tolerance=cfg.tolerance,
            ),
            model=chosen_model(cfg.checkpoint),
            refine=cfg.refine,
        )
        status.update("drawing")
        write(answer, folder)
    tell(answer, folder)
    if answer.plan is None:
        sys.exit(NO_PLAN)


def chosen_model(checkpoint: str | None) -> StructuredModel | None:
    """The model with the given weights; None: the default one."""
    if checkpoint is None:
        return None
    return trained_model(SHIPPED if checkpoint == "shipped" else Path(checkpoint))


def write(answer: Inference, folder: Path) -> None:
    """Actions (if there is a plan) and animation."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_inference(answer, folder / "motion.gif")
    if answer.plan is not None:
        save(folder / "actions.json", answer.solution())


def tell(answer: Inference, folder: Path) -> None:
    """What was seen, what is planned, where it is."""
    seen = answer.planned.perceived
    print(
        f"perceived: {len(seen.vertices)} corners, residual {seen.residual:.1f} of 255, "
        f"{answer.view.scale * 1e3:.3g} mm per pixel, floor at row {answer.view.floor:.1f}"
    )
    print(f"{answer.status}{': ' + answer.reason if answer.reason else ''}")
    if answer.result is not None:
        mm, deg = answer.result.final_error
        print(f"simulated: ends {mm:.2f} mm and {deg:.2f} deg from the goal")
    print(f"animation: {folder / 'motion.gif'}")
    if answer.plan is not None:
        actions = folder / "actions.json"
        print(f"actions: {actions}; next: python -m expert verify {actions}")


if __name__ == "__main__":
    main()
