import json
from pathlib import Path

import pytest

from dlm.evaluation.extras import Extra, read_extras
from dlm.evaluation.report import template
from expert.errors import InvalidProblem

TABLE = {
    "title": "top-k",
    "caption": "a <caption>",
    "command": "python make.py",
    "columns": ["k", "loss", "note"],
    "rows": [[1, 0.012345, "x<y"], [8, None, "z"]],
}
CURVE = {
    "title": "size",
    "x": "tasks",
    "y": "loss",
    "series": {"a": [[200, 0.1], [20, 1.0]], "b": [[20, 2.0], [200, 0.2]]},
}


def section(extra: Extra) -> str:
    """As the report shows it."""
    return str(template("report_parts.html").module.extra_section(extra))  # type: ignore[attr-defined]


def test_files_and_folders_of_results_are_read(tmp_path: Path) -> None:
    (tmp_path / "b.json").write_text(json.dumps(CURVE))
    (tmp_path / "a.json").write_text(json.dumps(TABLE))
    assert [e.title for e in read_extras([tmp_path, tmp_path / "b.json"])] == ["top-k", "size", "size"]


def test_a_table_is_shown_with_its_command_and_nothing_of_it_is_code() -> None:
    shown = section(Extra(**TABLE))  # type: ignore[arg-type]
    assert "<td>0.0123</td>" in shown
    assert "<td>–</td>" in shown
    assert "x&lt;y" in shown
    assert "a &lt;caption&gt; Made by: python make.py" in shown


def test_a_chart_has_a_line_per_series_in_order_of_x() -> None:
    figure = Extra(**CURVE).chart()  # type: ignore[arg-type]
    lines = figure.axes[0].get_lines()
    assert [line.get_label() for line in lines] == ["a", "b"]
    assert list(lines[0].get_xdata()) == [20, 200]
    assert 'class="chart"' in section(Extra(**CURVE))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text", ["", "[1]", '{"title": "x"}', '{"title": "x", "columns": ["a"], "rows": [[1, 2]]}', '{"name": 1}']
)
def test_other_files_are_refused_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(
        InvalidProblem, match=r"^extras .*x\.json: expected a table or a chart of results, got [^\n]+$"
    ):
        read_extras([tmp_path / "x.json"])
    with pytest.raises(InvalidProblem, match="nowhere"):
        read_extras([tmp_path / "nowhere.json"])
