"""Table 4.1: object-trajectory loss and times of every architecture, between doing nothing and the oracle."""

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise

import numpy as np

from dlm.evaluation.outcomes import Outcome
from dlm.evaluation.significance import Comparison

DATASETS = {"train": "train", "finetune": "fine-tune", "test": "test", "family": "family"}
"""Columns and their headings."""
CLIP = 10.0
"""Largest loss of a single task that counts in full [cm^2]; doing nothing costs about 1."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One architecture on one data set; means over tasks, then over seeds.

    loss, median: object-trajectory loss [cm^2]; spread: its standard deviation over seeds; ratio: to the loss of no action.
    clipped: that ratio with no single loss above CLIP, so that one object that is flung away does not outweigh all others.
    finger_loss [cm^2]: none where the fingers wait on purpose.  rms_mm, rms_deg: errors over the motion.
    within: share of tasks that end within 2 mm and 2 deg.  dropped, unsolved: per seed, the tasks in which the object ended
    too low, and those whose program was not solved.
    """

    tasks: int
    loss: float
    spread: float
    median: float
    ratio: float
    clipped: float
    finger_loss: float | None
    rms_mm: float
    rms_deg: float
    within: float
    dropped: list[list[int]]
    unsolved: list[list[int]]

    @classmethod
    def of(cls, outcomes: Sequence[Outcome], idle: Outcome) -> "Cell":
        """Of one architecture's outcomes, one per seed."""
        losses = [o.object_loss.mean() for o in outcomes]
        waiting = any(o is idle for o in outcomes)
        rms_mm, rms_deg = np.mean([o.rms for o in outcomes], axis=0)
        return cls(
            tasks=len(idle.poses),
            loss=float(np.mean(losses)),
            spread=float(np.std(losses, ddof=1)) if len(losses) > 1 else 0.0,
            median=float(np.median([o.object_loss for o in outcomes])),
            ratio=float(np.mean(losses) / idle.object_loss.mean()),
            clipped=_clipped(outcomes) / _clipped([idle]),
            finger_loss=None if waiting else float(np.mean([o.finger_loss.mean() for o in outcomes])),
            rms_mm=float(rms_mm),
            rms_deg=float(rms_deg),
            within=float(np.mean([o.success.mean() for o in outcomes])),
            dropped=[np.flatnonzero(o.dropped).tolist() for o in outcomes],
            unsolved=[np.flatnonzero(~o.solved).tolist() for o in outcomes],
        )


def _clipped(outcomes: Sequence[Outcome]) -> float:
    return float(np.mean([np.minimum(o.object_loss, CLIP).mean() for o in outcomes]))


@dataclass(frozen=True, kw_only=True)
class Line:
    """One row: its cells by data set, and seconds per task where they mean something.

    judged: whether it is an architecture, to be held against doing nothing and the oracle.
    """

    model: str
    cells: dict[str, Cell]
    forward: float | None = None
    backward: float | None = None
    judged: bool = True


@dataclass(frozen=True, kw_only=True)
class Table:
    """All rows, and how they came about: command, seeds, versions, machine."""

    lines: list[Line]
    origin: dict[str, object]
    comparisons: list[Comparison] = field(default_factory=list)

    def as_json(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)

    def as_csv(self) -> str:
        """One record per architecture and data set."""
        out = io.StringIO()
        lists = ("dropped", "unsolved")
        names = [n for n in Cell.__dataclass_fields__ if n not in lists]
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["model", "dataset", *names, *lists, "forward_s", "backward_s"])
        for line in self.lines:
            for dataset, cell in line.cells.items():
                numbers = [getattr(cell, n) for n in names]
                counts = [sum(map(len, getattr(cell, n))) for n in lists]
                writer.writerow([line.model, dataset, *numbers, *counts, line.forward, line.backward])
        return out.getvalue()

    def as_markdown(self) -> str:
        """The table of the thesis, then what its one number hides."""
        sections = [
            "# Table 4.1",
            "Object-trajectory loss [cm²] (mean over tasks and seeds ± standard deviation over seeds) and seconds per task.",
            _grid(*self.main()),
            *(f"{title}\n\n{_grid(*self.detail(kind))}" for kind, title in DETAILS.items()),
            *self._tests(),
            "Objects that end more than 5 mm too low, by task number (seeds apart by |)\n\n" + self._drops(),
            "How it came about\n\n" + "\n".join(f"* {k}: {v}" for k, v in self.origin.items()),
        ]
        return "\n\n".join(sections) + "\n"

    def main(self) -> tuple[list[str], list[list[str]]]:
        """Heading and rows of the table of the thesis."""
        head = ["model", *(DATASETS[d] for d in self._datasets), "forward s", "backward s"]
        rows = [
            [x.model, *(_loss(c) for c in x.cells.values()), _seconds(x.forward), _seconds(x.backward)]
            for x in self.lines
        ]
        return head, rows

    def detail(self, kind: str) -> tuple[list[str], list[list[str]]]:
        """Heading and rows of one of DETAILS."""
        rows = [[x.model, *(_detail(c, kind) for c in x.cells.values())] for x in self.lines]
        return ["model", *(DATASETS[d] for d in self._datasets)], rows

    def _tests(self) -> list[str]:
        """Sections of the paired tests, one per data set."""
        names = dict.fromkeys(c.dataset for c in self.comparisons)
        order = (
            [
                "Does the thesis's order appear, losses falling from NN to MDR to CVX to DLM?\n\n"
                + _grid(*order_rows(self.comparisons))
            ]
            if self.comparisons
            else []
        )
        return order + [
            f"Paired tests, {DATASETS[name]}: loss of the second minus the first; p values corrected (Holm) over all data sets\n\n"
            + _grid(*comparison_rows([c for c in self.comparisons if c.dataset == name]))
            for name in names
        ]

    @property
    def _datasets(self) -> list[str]:
        return list(self.lines[0].cells)

    def _drops(self) -> str:
        lines = []
        for x in self.lines:
            parts = [
                f"{DATASETS[d]} {' | '.join(' '.join(map(str, seed)) or '–' for seed in c.dropped)}"
                for d, c in x.cells.items()
            ]
            lines.append(f"* {x.model}: " + "; ".join(parts))
        return "\n".join(lines)


def comparison_rows(comparisons: Sequence[Comparison]) -> tuple[list[str], list[list[str]]]:
    """Heading and rows of paired tests on one data set."""
    head = ["", "Δ [cm²]", "95 % interval", "better on", "p, ranks", "p, mean", "told"]
    rows = [
        [
            f"{c.first} → {c.second}",
            _signed(c.difference),
            f"{_signed(c.low)} to {_signed(c.high)}",
            f"{c.better:.0%} of tasks",
            _p(c.p_ranks),
            _p(c.p_mean),
            c.verdict,
        ]
        for c in comparisons
    ]
    return head, rows


THESIS_ORDER = ("NN", "MDR", "CVX", "DLM")
"""Of falling loss in the thesis, on every data set."""


def order_rows(comparisons: Sequence[Comparison]) -> tuple[list[str], list[list[str]]]:
    """Heading and rows: does each step of the thesis's order appear?"""
    found = {(c.first, c.second, c.dataset): c.verdict for c in comparisons}
    names = list(dict.fromkeys(c.dataset for c in comparisons))
    steps = [pair for pair in pairwise(THESIS_ORDER) if any(key[:2] == pair for key in found)]
    rows = [[f"{b} against {a}", *(found.get((a, b, d), "–") for d in names)] for a, b in steps]
    return ["", *(DATASETS.get(d, d) for d in names)], rows


def _signed(value: float) -> str:
    return f"{value:+.3f}".replace("-", "−") if abs(value) >= 1e-3 else f"{value:+.0e}".replace("-", "−")


def _p(value: float) -> str:
    return f"{value:.3f}" if value >= 1e-3 else "< 0.001"


DETAILS = {
    "ratio": "Loss / loss of no action",
    "clipped": "Loss / loss of no action, single losses cut at 10 cm²",
    "median": "Median loss [cm²]",
    "within": "Share of tasks that end within 2 mm and 2°",
    "rms": "RMS error over the motion [mm, °]",
    "finger": "Finger-trajectory loss [cm²], against the expert's positions",
    "drops": "Objects that end too low, dropped or never lifted, per seed (in brackets: programs not solved)",
}


def _loss(cell: Cell) -> str:
    seeds = len(cell.dropped)
    return _number(cell.loss) + (f" ± {_number(cell.spread)}" if seeds > 1 else "")


def _detail(cell: Cell, kind: str) -> str:
    seeds = len(cell.dropped)
    drops, unsolved = (sum(map(len, lists)) / seeds for lists in (cell.dropped, cell.unsolved))
    return {
        "ratio": _number(cell.ratio),
        "clipped": _number(cell.clipped),
        "median": _number(cell.median),
        "within": f"{cell.within:.3f}",
        "rms": f"{_short(cell.rms_mm)}, {_short(cell.rms_deg)}",
        "finger": "–" if cell.finger_loss is None else _number(cell.finger_loss),
        "drops": f"{drops:g} of {cell.tasks}" + (f" ({unsolved:g})" if unsolved else ""),
    }[kind]


def _number(value: float) -> str:
    """Three digits where it matters, never a misleading 0.000."""
    return f"{value:.3f}" if value >= 1e-3 or value == 0 else f"{value:.1e}"


def _short(value: float) -> str:
    return f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _grid(head: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]]
    return "\n".join(lines)
