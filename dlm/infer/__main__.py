"""Command line: `python -m dlm.infer video=clip.mp4 scale=0.001` or `object_size=0.08`; configs/infer.yaml lists all options.

Exit codes: 0 planned; 4 no plan found; 2 bad input; 130 interrupted.
"""

import sys
from dataclasses import fields
from pathlib import Path

from omegaconf import DictConfig
from rich.console import Console

from datasets.entry import entry_point, swept
from dlm.infer.clip import VideoFile
from dlm.infer.drawing import draw_inference
from dlm.infer.inference import Given, Inference, infer
from dlm.infer.segmentation import Segmentation
from dlm.neural import weights as neural
from dlm.structured import StructuredModel
from dlm.structured.weights import SHIPPED, trained_model
from expert.files.document import encoded
from expert.files.output import Output, folder, writable
from expert.world.values import require

NO_PLAN = 4


@entry_point("infer")
def main(cfg: DictConfig) -> None:
    """Perceive, plan, simulate; write actions and animation."""
    file = VideoFile(path=cfg.video, start=cfg.start, end=cfg.end, rate=cfg.rate)
    given = Given(**{field.name: cfg[field.name] for field in fields(Given)})
    told = Segmentation(colour=cfg.colour, background=cfg.background, tolerance=cfg.tolerance)
    model = chosen_model(cfg.model.name, cfg.checkpoint)
    place = Path(cfg.out or Path("outputs") / "infer" / Path(cfg.video).stem) / swept("video", "out")
    require(not place.exists() or place.is_dir(), "out", "a folder", f"{place}, a file")
    with folder(place), Output(place / "actions.json") as actions:
        writable(place / "motion.gif")
        with Console(stderr=True).status("perceiving and planning") as status:
            answer = infer(file, given, segmentation=told, model=model, refine=cfg.refine)
            if answer.plan is not None:
                actions.deliver(encoded(answer.solution()))
            status.update("drawing")
            draw_inference(answer, place / "motion.gif")
    tell(answer, place)
    if answer.plan is None:
        sys.exit(NO_PLAN)


def chosen_model(name: str, checkpoint: str | None) -> StructuredModel | None:
    """The model with the given weights; None: the default one."""
    require(name in ("structured", "neural"), "model", "structured or neural", name)
    if name == "neural":
        return neural.shipped() if checkpoint in (None, "shipped") else neural.trained(Path(checkpoint))
    if checkpoint is None:
        return None
    return trained_model(SHIPPED if checkpoint == "shipped" else Path(checkpoint))


def tell(answer: Inference, place: Path) -> None:
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
    print(f"animation: {place / 'motion.gif'}")
    if answer.plan is not None:
        actions = place / "actions.json"
        print(f"actions: {actions}; next: python -m expert verify {actions}")


if __name__ == "__main__":
    main()
