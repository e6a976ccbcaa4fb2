"""One HTML file with tables, curves and animated examples, that opens without a network."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from matplotlib.figure import Figure

from dlm.evaluation.table import DETAILS, Table

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 1200px; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: .6em 0 1.4em; font-variant-numeric: tabular-nums; }
th, td { white-space: nowrap; padding: .25em .8em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 2px solid #444; }
figure { margin: 1em 0; } figcaption { color: #555; max-width: 60em; }
img { max-width: 100%; }
.films { display: flex; flex-wrap: wrap; gap: 1em; align-items: flex-end; } .films figure { margin: 0; text-align: center; }
.video { image-rendering: pixelated; } .details { columns: 2; } .details details { break-inside: avoid; }
details { margin: .5em 0; } summary { cursor: pointer; font-weight: 600; }
"""

INTRODUCTION = """
Every architecture sees the same videos and gives the same action: finger positions and forces at the knots, executed by the
same layer, which is told the desired object path, in the same rigid-contact simulator. NN and NNM are trained on positions
and forces (the thesis trains them on positions alone). <b>No action</b> is the loss of fingers that do nothing: a loss above
it does harm. <b>MIQP (oracle)</b> is the expert's plan, found with all true parameters.
"""


@dataclass(frozen=True, kw_only=True)
class Example:
    """One task: a title, its strip of pictures, and animated SVG pictures by architecture."""

    title: str
    strip: Figure
    films: dict[str, str]


def html_report(table: Table, curves: Figure, examples: Sequence[Example]) -> str:
    """The whole page."""
    details = "".join(
        f"<details open><summary>{escape(title)}</summary>{_table(*table.detail(kind))}</details>"
        for kind, title in DETAILS.items()
    )
    origin = "".join(
        f"<tr><td>{escape(k)}</td><td>{escape(str(v))}</td></tr>" for k, v in table.origin.items()
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Manipulation from video: Table 4.1</title><style>{STYLE}</style></head><body>
<h1>Manipulation from video</h1><p>{INTRODUCTION}</p>
<h2>Table 4.1: object-trajectory loss [cm²] and seconds per task</h2>{_table(*table.main())}
<div class="details">{details}</div>
<h2>Training curves</h2>{_figure(curves, "As Fig. 4-6 of the thesis: losses in the rigid simulator while the stages learn.")}
<h2>Examples</h2>
<p>Dashed: desired motion. Yellow: simulated object. Dots: fingers; lines: forces. In rows called <i>derendered</i>, coloured
segments are the facets that the network assigns to each finger (faint while not in contact), triangles ground contacts.</p>
{"".join(_example(example) for example in examples)}
<h2>How it came about</h2><table>{origin}</table>
</body></html>
"""


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _figure(figure: Figure, caption: str) -> str:
    return f'<figure><img alt="{escape(caption)}" src="{png(figure)}"><figcaption>{escape(caption)}</figcaption></figure>'


def png(figure: Figure) -> str:
    """A figure as a data URL."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


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
