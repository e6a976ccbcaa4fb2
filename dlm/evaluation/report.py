"""One HTML file with tables, tests, curves and animated examples, that opens without a network."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

from matplotlib.figure import Figure

from dlm.evaluation.extras import Extra, chart
from dlm.evaluation.style import STYLE
from dlm.evaluation.table import DATASETS, DETAILS, Cell, Table, comparison_rows, order_rows

INTRODUCTION = """
Videos of a moving polygon go in, positions and forces of two point fingers come out. Every architecture sees the same videos,
gives the same kind of action, and is judged alike: its action is executed in the same rigid-contact simulator, and the
object's motion is held against the demonstrated one.
"""
READING = """
Mean over tasks and seeds ± standard deviation over seeds. <b>No action</b> is the loss of fingers that do nothing: green cells
beat it by more than 5 %, red ones do harm. <b>MIQP (oracle)</b> is the expert's plan, found with all true parameters. Losses
are means over x, y and 0.03 m · sin θ at five frames of the squared error in cm²; one dropped object costs 0.5 to 3 cm². Times
are of one processor core: from video to action (of planning, for the oracle) and, per task of a training batch, from loss to gradients.
NN and NNM are trained on positions and forces (the thesis: on positions alone), because execution needs both.
"""
TESTS = """
Each row asks whether the second architecture does better than the first on the same tasks, losses averaged over seeds.
Δ: mean loss of the second minus the first, with its 95 % bootstrap interval. p: Wilcoxon's signed ranks (does one side win on
most tasks?) and random sign flips (is the mean difference zero?), two-sided, corrected by Holm's method over all rows here.
"""
ORDER = "Does the thesis's order appear, losses falling from NN to MDR to CVX to DLM?"
FILMS = """
Dashed: demonstrated motion. Filled: the object in the simulator. Dots: fingers. In the frame-by-frame strips, lines are forces;
in rows called <i>derendered</i>, coloured segments are the facets that the network assigns to each finger (faint while not
in contact), triangles ground contacts.
"""
CURVES = "As Fig. 4-6 of the thesis: losses in the rigid simulator while the stages learn. Lines: means over seeds; bands: from the best to the worst seed."
QUALITATIVE = """As Fig. 4-7 of the thesis, first seed, tasks at fixed numbers: the object at five times, from faint to strong; dashed: where
it was to end; dots: fingers at the knots, filled while they push. Numbers: object-trajectory loss; ✓: ends within 2 mm and 2°."""


@dataclass(frozen=True, kw_only=True)
class Example:
    """One task: a title, its strip of pictures, and animated SVG pictures by architecture."""

    title: str
    strip: Figure
    films: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the page shows."""

    table: Table
    curves: Figure
    qualitative: Figure
    examples: Sequence[Example]
    extras: Sequence[Extra] = field(default_factory=list)

    def html(self) -> str:
        """The whole page."""
        sections = {
            "Table 4.1": self._table(),
            "Paired tests": self._tests(),
            "Curves": _figure(self.curves, CURVES),
            "Whole motions": _figure(self.qualitative, QUALITATIVE),
            **{extra.title: extra_section(extra) for extra in self.extras},
            "Examples": _note(FILMS) + "".join(map(_example, self.examples)),
            "How it came about": self._origin(),
        }
        links = "".join(f'<a href="#{_anchor(title)}">{escape(title)}</a>' for title in sections)
        body = "".join(
            f'<h2 id="{_anchor(title)}">{escape(title)}</h2>{content}' for title, content in sections.items()
        )
        return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Manipulation from video</title><style>{STYLE}</style></head><body>
<h1>Manipulation from video</h1><p>{INTRODUCTION}</p><nav>{links}</nav>
{body}
</body></html>
"""

    def _table(self) -> str:
        head, rows = self.table.main()
        marks = [
            ["", *(_mark(cell) for cell in line.cells.values()), "", ""] if line.judged else [""] * len(head)
            for line in self.table.lines
        ]
        details = "".join(
            f"<div><h3>{escape(title)}</h3>{_grid(*self.table.detail(kind))}</div>"
            for kind, title in DETAILS.items()
        )
        title = "<h3>Object-trajectory loss [cm²] and seconds per task</h3>"
        return title + _grid(head, rows, marks) + _note(READING) + f'<div class="pair">{details}</div>'

    def _tests(self) -> str:
        names = dict.fromkeys(c.dataset for c in self.table.comparisons)
        parts = [
            f"<div><h3>{escape(DATASETS.get(name, name))}</h3>"
            + _grid(*comparison_rows([c for c in self.table.comparisons if c.dataset == name]))
            + "</div>"
            for name in names
        ]
        order = _grid(*order_rows(self.table.comparisons)) if parts else ""
        return f"<h3>{ORDER}</h3>" + order + _note(TESTS) + "".join(parts)

    def _origin(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(k)}</td><td>{escape(_plain(v))}</td></tr>" for k, v in self.table.origin.items()
        )
        return f'<div class="scroll"><table class="words origin"><tbody>{rows}</tbody></table></div>'


def _mark(cell: Cell) -> str:
    return "good" if cell.ratio < 0.95 else "bad" if cell.ratio > 1.05 else ""


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in value.items())
    return str(value)


def _note(text: str) -> str:
    return f'<p class="note">{text.strip()}</p>'


def _anchor(title: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in title.lower())


def _grid(
    head: Sequence[str], rows: Sequence[Sequence[str]], marks: Sequence[Sequence[str]] | None = None
) -> str:
    """A table that scrolls by itself where it is wider than the page; marks: a class for each cell."""
    marks = marks or [[""] * len(head)] * len(rows)
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="{mark}">{escape(cell)}</td>' if mark else f"<td>{escape(cell)}</td>"
            for cell, mark in zip(row, line, strict=True)
        )
        + "</tr>"
        for row, line in zip(rows, marks, strict=True)
    )
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _figure(figure: Figure, caption: str) -> str:
    words = escape(" ".join(caption.split()))
    data = base64.b64encode(png(figure)).decode()
    return f'<figure><div class="wide"><img class="chart" alt="{words}" src="data:image/png;base64,{data}"></div><figcaption>{words}</figcaption></figure>'


def png(figure: Figure) -> bytes:
    """A figure as a file."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=130)
    return out.getvalue()


def extra_section(extra: Extra) -> str:
    """A result of another experiment: its table or chart, and what made it."""
    caption = extra.caption + (f" Made by: {extra.command}" if extra.command else "")
    table = (
        _grid(extra.columns, [[_cell(value) for value in row] for row in extra.rows]) if extra.rows else ""
    )
    picture = _figure(chart(extra), extra.title) if extra.series else ""
    return table + picture + _note(escape(caption))


def _cell(value: str | float | int | None) -> str:
    return f"{value:.3g}" if isinstance(value, float) else "–" if value is None else str(value)


def _example(example: Example) -> str:
    films = "".join(
        f"<figure>{svg}<figcaption>{escape(name)}</figcaption></figure>"
        for name, svg in example.films.items()
    )
    strip = _figure(example.strip, example.title)
    return (
        f'<h3>{escape(example.title)}</h3><div class="films">{films}</div>'
        f"<details><summary>Frame by frame</summary>{strip}</details>"
    )
