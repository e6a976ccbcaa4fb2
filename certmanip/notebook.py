"""Cases as notebooks show them: a picture, and what the checker says."""

import base64
import tempfile
from html import escape
from pathlib import Path
from typing import Any, Protocol

from expert.errors import InvalidProblem
from expert.verify.report import Report


class Shown(Protocol):
    """What is asked of a case here."""

    @property
    def answer(self) -> Any: ...

    @property
    def kind(self) -> str: ...

    @property
    def status(self) -> str: ...

    def verify(self) -> Report: ...

    def draw(self, path: Path) -> None: ...


def page(case: Shown) -> str:
    """HTML that needs nothing else: kind and status; the report and the picture of what there is to check and to draw."""
    heading = f"<b>{escape(case.kind.replace('_', ' '))}</b>: {escape(case.status)}"
    if case.status == "open":
        return f"<div>{heading}</div>"
    parts = [heading]
    if reason := getattr(case.answer, "reason", ""):
        parts.append(escape(reason))
    try:
        report = case.verify()
        parts.append(f"checked: <b>{escape(report.verdict)}</b>")
        parts.append(
            f"<details><summary>what was checked</summary><pre>{escape(str(report))}</pre></details>"
        )
        parts.append(_picture(case))
    except InvalidProblem:
        pass  # an answer without fingers claims nothing, and there is nothing to draw
    return f"<div>{'<br>'.join(parts)}</div>"


def _picture(case: Shown) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        case.draw(path)
        content = base64.b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{escape(case.kind)}" style="max-width:100%" src="data:image/png;base64,{content}">'
