"""One HTML file with tables, tests, curves and animated examples, that opens without a network; and the files beside it."""

import base64
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, field

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from matplotlib.figure import Figure

from dlm.evaluation.extras import Extra
from dlm.evaluation.table import DATASETS, DETAILS, Line, Table, comparison_rows, order_rows

FILES = (
    *("table_4_1.md", "table_4_1.csv", "table_4_1.json"),
    *("figure_4_6.png", "figure_4_7.png", "report.html"),
)
"""What a report is written to."""


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
        extras = [extra.title for extra in self.extras]
        comparisons = self.table.comparisons
        names = dict.fromkeys(c.dataset for c in comparisons)
        return template("report.html").render(
            vars(self),
            titles=[
                "Table 4.1",
                "Paired tests",
                "Curves",
                "Whole motions",
                *extras,
                "Examples",
                "How it came about",
            ],
            details=DETAILS,
            marks=[_marks(line) for line in self.table.lines],
            order=order_rows(comparisons),
            tests={
                DATASETS.get(name, name): comparison_rows([c for c in comparisons if c.dataset == name])
                for name in names
            },
        )

    def files(self) -> dict[str, bytes]:
        """Table, figures and page, by the names of their files."""
        contents = (
            self.table.as_markdown().encode(),
            self.table.as_csv().encode(),
            json.dumps(self.table.as_json(), indent=1).encode(),
            png(self.curves),
            png(self.qualitative),
            self.html().encode(),
        )
        return dict(zip(FILES, contents, strict=True))


def template(name: str) -> Template:
    """A page, or parts of one, which are the macros of its `module`."""
    environment = Environment(
        loader=PackageLoader("dlm.evaluation", ""), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["anchor"] = lambda title: "".join(c if c.isalnum() else "-" for c in title.lower())
    environment.filters["base64png"] = lambda figure: base64.b64encode(png(figure)).decode()
    return environment.get_template(name)


def _marks(line: Line) -> list[str]:
    """A class for each cell of a row of the first table: better or worse than doing nothing."""
    ratios = [cell.ratio if line.judged else 1.0 for cell in line.cells.values()]
    return ["", *("good" if r < 0.95 else "bad" if r > 1.05 else "" for r in ratios), "", ""]


def png(figure: Figure) -> bytes:
    """A figure as a file."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=130)
    return out.getvalue()
