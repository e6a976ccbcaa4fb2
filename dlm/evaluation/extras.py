"""Results of other experiments (ablations, data-size curves) that the report shows: JSON files, one table or chart each.

`{"title": ..., "caption": ..., "columns": [...], "rows": [[...], ...]}` is a table,
`{"title": ..., "caption": ..., "x": "tasks", "y": "loss [cm²]", "series": {"structured": [[20, 0.1], ...]}}` a chart.
`"command"` says what made it.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from expert.errors import InvalidProblem


@dataclass(frozen=True, kw_only=True)
class Extra:
    """One result: a table (columns, rows) or a chart (x, y, series of points), and the command that made it."""

    title: str
    caption: str = ""
    command: str = ""
    columns: list[str] = field(default_factory=list)
    rows: list[list[str | float | int | None]] = field(default_factory=list)
    x: str = ""
    y: str = ""
    series: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        uneven = [row for row in self.rows if len(row) != len(self.columns)]
        if not (self.rows or self.series) or uneven:
            raise InvalidProblem(
                self.title, expected="rows as long as columns, or series", got=f"{len(uneven)} uneven rows"
            )

    def cells(self) -> list[list[str]]:
        """Rows of the table as text."""
        return [[_cell(value) for value in row] for row in self.rows]

    def chart(self) -> Figure:
        """Lines through the points of every series, on logarithmic axes."""
        figure = Figure(figsize=(6.5, 4), layout="constrained")
        ax = figure.subplots()
        for name, points in self.series.items():
            x, y = zip(*sorted(points), strict=True)
            ax.plot(x, y, "o-", lw=1.4, ms=4, label=name)
        ax.set(xlabel=self.x, ylabel=self.y, xscale="log", yscale="log")
        ax.grid(alpha=0.25, which="both", lw=0.5)
        ax.legend(fontsize=8)
        return figure


def _cell(value: str | float | int | None) -> str:
    return f"{value:.3g}" if isinstance(value, float) else "–" if value is None else str(value)


def read_extras(paths: Iterable[str | Path]) -> list[Extra]:
    """Results in files, and in all JSON files of folders.  Raises InvalidProblem for a file that holds none."""
    given = [Path(path) for path in paths]
    return [
        _read(file) for path in given for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])
    ]


def _read(path: Path) -> Extra:
    try:
        return Extra(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError, InvalidProblem) as error:
        raise InvalidProblem(
            f"extras {path}", expected="a table or a chart of results", got=f"{error}".splitlines()[0]
        ) from error
