"""Training curves (Fig. 4-6): finger- and object-trajectory losses over the iterations of every stage."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dlm.evaluation.trained import title_of
from dlm.training.loop import Row

COLOURS = {"nn": "#c44e52", "nnm": "#dd8452", "mdr": "#4c72b0", "cvx": "#2e8b57", "dlm": "#8172b3"}
COLOURS["cvx_longer"] = "#9bc25e"
LINES = {"train": "-", "finetune": "-", "test": "--", "family": ":"}
NAMES = {"train": "train", "finetune": "fine-tune", "test": "test", "family": "family"}

PANELS = (
    ("Finger-trajectory loss", "finger", ("nn", "mdr", "cvx"), ("train", "test", "family")),
    ("Object-trajectory loss", "object", ("nn", "mdr", "cvx"), ("train", "test", "family")),
    (
        "Object-trajectory loss, fine-tuning",
        "object",
        ("nnm", "dlm", "cvx_longer"),
        ("finetune", "test", "family"),
    ),
)

Histories = Mapping[str, Sequence[Sequence[Row]]]
"""Logged rows by stage, one list per seed."""


def curves_figure(
    histories: Histories, no_action: Mapping[str, float], oracle: Mapping[str, float]
) -> Figure:
    """Three panels as in the thesis; lines are means over seeds, bands reach from the best to the worst.

    no_action, oracle: object losses of doing nothing and of the expert's plans, by data set [cm^2]; the expert's finger loss is 0.
    """
    figure = Figure(figsize=(13, 5), layout="constrained")
    for ax, (title, kind, stages, datasets) in zip(figure.subplots(1, 3), PANELS, strict=True):
        for stage in stages:
            for dataset in datasets:
                _line(ax, histories.get(stage, []), f"{kind}/{dataset}", COLOURS[stage], stage, dataset)
        if kind == "object":
            ax.axhline(no_action["test"], color="0.5", lw=1, label="no action, test")
            ax.axhline(oracle["test"], color="0.1", lw=1, ls="-.", label="MIQP (oracle), test")
        ax.set(title=title, xlabel="iteration", ylabel="cm²", yscale="log")
        ax.grid(alpha=0.25, which="both", lw=0.5)
        if ax.get_lines():
            ax.legend(fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
    return figure


def _line(ax: Axes, seeds: Sequence[Sequence[Row]], key: str, colour: str, stage: str, dataset: str) -> None:
    if not seeds or not seeds[0]:
        return
    iterations = [row["iteration"] for row in seeds[0]]
    values = np.array([[row[key] for row in rows] for rows in seeds])
    label = f"{title_of(stage)}, {NAMES[dataset]}"
    ax.plot(iterations, values.mean(0), LINES[dataset], color=colour, lw=1.4, label=label)
    if len(values) > 1:
        ax.fill_between(iterations, values.min(0), values.max(0), color=colour, alpha=0.12, lw=0)
