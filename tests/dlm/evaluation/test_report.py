import re

from matplotlib.figure import Figure

from dlm.evaluation.outcomes import execute
from dlm.evaluation.report import Example, Report, png
from dlm.evaluation.table import Cell, Line, Table
from dlm.execution import idle_action
from dlm.tasks import TaskBatch
from tests.support.outcomes import RIGID, outcome


def report(tasks: TaskBatch) -> Report:
    """Nothing done, something good and something bad, on one data set."""
    idle = execute(idle_action(tasks), tasks, RIGID)
    rows = {"no action": idle, "GOOD": outcome(tasks), "BAD": outcome(tasks, x=1.0)}
    lines = [
        Line(model=name, cells={"test": Cell.of([o], idle)}, judged=name != "no action")
        for name, o in rows.items()
    ]
    example = Example(title="a <b>", strip=Figure(figsize=(1, 1)), films={"x & y": "<svg id='film'/>"})
    return Report(
        table=Table(lines=lines, origin={"command": "make <this>", "data": {"train": "abc"}}),
        curves=Figure(figsize=(1, 1)),
        qualitative=Figure(figsize=(2, 1)),
        examples=[example],
    )


def test_cells_are_marked_where_they_differ_from_doing_nothing(tasks: TaskBatch) -> None:
    page = report(tasks).html()
    marks = re.findall(r"<tr><td>([^<]+)</td><td( class=\"\w+\")?>", page)
    assert dict(marks[:3]) == {"no action": "", "GOOD": ' class="good"', "BAD": ' class="bad"'}


def test_what_comes_from_outside_is_text_and_films_are_drawn(tasks: TaskBatch) -> None:
    page = report(tasks).html()
    assert "a &lt;b&gt;" in page
    assert "make &lt;this&gt;" in page
    assert "x &amp; y" in page
    assert "<svg id='film'/>" in page
    assert re.search(r"train\s+abc", page)


def test_every_link_of_the_page_leads_to_a_heading(tasks: TaskBatch) -> None:
    page = report(tasks).html()
    links = re.findall(r'<a href="#([^"]+)"', page)
    assert len(links) == 6
    assert set(links) == set(re.findall(r'<h2 id="([^"]+)"', page))


def test_the_files_are_those_that_the_page_is_made_of(tasks: TaskBatch) -> None:
    one = report(tasks)
    files = one.files()
    assert files["report.html"].decode() == one.html()
    assert files["table_4_1.md"].decode() == one.table.as_markdown()
    assert files["figure_4_7.png"] == png(one.qualitative)
    assert files["figure_4_6.png"][:4] == b"\x89PNG"
    assert len(files) == 6
