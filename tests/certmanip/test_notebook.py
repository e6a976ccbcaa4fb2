"""What a notebook shows of a case."""

import base64
import io
import re

import numpy as np
from PIL import Image

from certmanip.cases import Case, cage, load
from expert.problems.cage import CageSolution


def test_an_answer_shows_picture_and_verdict() -> None:
    page = load("shipped:cage/i_given")._repr_html_()
    assert "checked: <b>caged</b>" in page
    assert "orientations within [-34.5, 34.5] deg" in page
    content = re.search(r'src="data:image/png;base64,([^"]+)"', page)
    assert content
    assert Image.open(io.BytesIO(base64.b64decode(content[1]))).width > 500


def test_what_is_not_solved_says_so_and_computes_nothing() -> None:
    assert load("shipped:certified_grasp/t")._repr_html_() == "<div><b>certified grasp</b>: open</div>"


def test_an_answer_without_fingers_shows_its_reason_as_text() -> None:
    asked = cage(object=0.1 * np.array([[0, 0], [1, 0], [0, 1]]), fingers={"count": 3})
    page = Case(problem=asked.problem, answer=CageSolution(status="none_found", reason="a < b"))._repr_html_()
    assert "none_found" in page
    assert "a &lt; b" in page
    assert "<img" not in page
