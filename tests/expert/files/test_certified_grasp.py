"""Files of certified grasping: what is accepted means what it says, and what is refused is refused in one line."""

import copy
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.files import problem_of, read_problem, read_solution, solution_of, write_solution
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.named import named_shape
from tests.support.polygons import GRASPED, irregular_polygon

FILES = sorted(Path("configs/problem/certified_grasp").glob("*.yaml"))
SQUARE = [[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]]


def grasp_file() -> dict[str, Any]:
    """Every key written out."""
    return {
        "schema": 1,
        "problem": "certified_grasp",
        "description": "a square",
        "object": {"vertices": copy.deepcopy(SQUARE)},
        "pose": [0.01, 0.02, 0.3],
        "fingers": {"count": 4, "grippers": [{"fingers": [0, 1], "opening": [0.0, 0.2]}], "parallel": True},
        "cost": "acceleration",
        "options": {"half_ranges": [20, 10, 1], "margin": 0.002, "time_limit": 10, "method": "miqp1"},
    }


def changed(path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    data = grasp_file()
    here: Any = data
    for key in path[:-1]:
        here = here[key]
    here[path[-1]] = value
    return data


def made_up_answer(rng: np.random.Generator) -> GraspSolution:
    return GraspSolution(
        status="certified",
        path=rng.normal(size=(3, 4, 2)),
        facets=(3, 0, 1, 2),
        starts=rng.normal(size=(5, 2)),
        objective=0.25,
        method="goal_cell",
        seconds=1.5,
        refuted=2,
    )


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_every_file_is_read(path: Path) -> None:
    problem = read_problem(path)
    assert isinstance(problem.task, GraspProblem)
    assert problem.task.half_ranges[0] == pytest.approx(np.radians(30 if path.stem.endswith("_30") else 15))
    assert problem.options["time_limit"] > 0


def test_random_and_named_files_hold_the_generated_shapes() -> None:
    expected = {f"random_{k:02d}": irregular_polygon(np.random.default_rng(k), 4 + k % 3) for k in range(12)}
    expected |= {name.lower(): named_shape(name) for name in GRASPED}
    for stem, vertices in expected.items():
        task = read_problem(f"configs/problem/certified_grasp/{stem}.yaml").task
        np.testing.assert_allclose(task.shape.vertices, vertices, atol=1e-6)


def test_a_file_means_what_it_says() -> None:
    problem = problem_of(grasp_file())
    task = problem.task
    np.testing.assert_array_equal(task.pose, [0.01, 0.02, 0.3])
    np.testing.assert_allclose(np.degrees(task.half_ranges), [20, 10, 1])
    assert (task.count, task.cost, task.margin) == (4, "acceleration", 0.002)
    assert task.grippers[0].opening == (0.0, 0.2)
    assert task.parallel
    assert problem.options == {"time_limit": 10.0, "method": "miqp1"}


def test_a_single_half_range_scales_the_default_schedule() -> None:
    task = problem_of(changed(("options", "half_ranges"), 30)).task
    np.testing.assert_allclose(np.degrees(task.half_ranges), [30, 22.5, 15, 7.5, 0.5])
    bare = {key: grasp_file()[key] for key in ("schema", "problem", "object")}
    np.testing.assert_allclose(np.degrees(problem_of(bare).task.half_ranges), [15, 11.25, 7.5, 3.75, 0.5])


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": (changed(("fingers", "cuont"), 4), "fingers.cuont: .* did you mean count"),
    "walls": (changed(("walls",), []), "walls: .* unknown key"),
    "five fingers": (changed(("fingers", "count"), 5), "fingers.count: expected 3 or 4"),
    "gripper of none": (changed(("fingers", "count"), 3) | {"fingers": {"count": 3, "grippers": [
        {"fingers": [0, 3], "opening": [0, 1]}]}}, "fingers.grippers: .* 0 to 2"),
    "increasing": (changed(("options", "half_ranges"), [5, 10]), "half_ranges: .* decreasing"),
    "one half-range": (changed(("options", "half_ranges"), [15]), "half_ranges: .* two or more"),
    "above ninety": (changed(("options", "half_ranges"), [91, 1]), "half_ranges: .* 90"),
    "small number": (changed(("options", "half_ranges"), 1.5), "half_ranges: .* list all"),
    "quoted": (changed(("options", "half_ranges"), "15"), "half_ranges: .* quotes"),
    "no margin": (changed(("options", "margin"), 0), "options.margin"),
    "method": (changed(("options", "method"), "magic"), "options.method: .* goal_cell or"),
    "cost": (changed(("cost",), "beauty"), "cost: .* attraction or acceleration"),
    "parallel": (changed(("fingers", "parallel"), 1), "fingers.parallel: .* true or false"),
    "nan": (changed(("pose", 2), math.nan), r"pose\[2\]: .* nan"),
    "crossing": (changed(("object", "vertices"), [SQUARE[k] for k in (0, 2, 1, 3)]), "object.vertices: .* cross"),
    "a point": (changed(("object", "vertices"), [[1, 1]] * 3), "object.vertices: .* larger"),
}  # fmt: skip


@pytest.mark.parametrize(("data", "message"), REFUSED.values(), ids=REFUSED)
def test_bad_input_is_refused_by_field(data: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidProblem) as caught:
        problem_of(data)
    assert re.search(message, line := str(caught.value)), line
    assert "\n" not in line


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from([15, 1e-300]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
NUMBERS = st.floats(-60, 60) | st.sampled_from([0, 4, 3, 1e9, -1e9, 1e-12])


def places(data: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path for key, value in items for path in [(*here, key), *places(value, (*here, key))]]


def test_malformed_files_are_refused_in_one_line_or_are_valid_problems() -> None:
    counts = {"read": 0, "refused": 0}

    @settings(max_examples=1000, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.sampled_from(places(grasp_file())), JUNK | NUMBERS)
    def reads_or_refuses(path: tuple[Any, ...], value: Any) -> None:
        try:
            task = problem_of(changed(path, value)).task
        except InvalidProblem as refusal:
            refused = str(refusal)
        else:
            assert np.isfinite(task.half_ranges).all()
            assert np.isfinite(task.pose).all()
            counts["read"] += 1
            return
        assert len(refused.splitlines()) == 1
        counts["refused"] += 1

    reads_or_refuses()
    assert min(counts.values()) >= 50, counts


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_solution_survives_writing_and_reading(tmp_path: Path, clockwise: bool) -> None:
    problem = problem_of(changed(("object", "vertices"), SQUARE[::-1] if clockwise else SQUARE))
    answer = made_up_answer(np.random.default_rng(0))
    write_solution(tmp_path / "s.json", problem, answer)
    again = read_solution(tmp_path / "s.json").answer
    np.testing.assert_array_equal(again.path, answer.path)
    np.testing.assert_array_equal(again.starts, answer.starts)
    assert again.facets == answer.facets
    for key in ("status", "objective", "method", "seconds", "refuted", "reason"):
        assert getattr(again, key) == getattr(answer, key)


def test_a_clockwise_file_gets_its_own_facet_numbers_back(tmp_path: Path) -> None:
    problem = problem_of(changed(("object", "vertices"), SQUARE[::-1]))
    write_solution(tmp_path / "s.json", problem, made_up_answer(np.random.default_rng(0)))
    written = json.loads((tmp_path / "s.json").read_text())
    listed, inside = np.array(SQUARE[::-1]), problem.task.shape.vertices
    for facet, file_facet in zip((3, 0, 1, 2), written["facets"], strict=True):
        ends = {tuple(inside[facet]), tuple(inside[(facet + 1) % 4])}
        assert ends == {tuple(listed[file_facet]), tuple(listed[(file_facet + 1) % 4])}


def test_an_answer_without_a_grasp_is_read_back(tmp_path: Path) -> None:
    problem = problem_of(grasp_file())
    write_solution(tmp_path / "s.json", problem, GraspSolution(status="none_found", reason="no facets fit"))
    strict = json.loads((tmp_path / "s.json").read_text(), parse_constant=lambda c: pytest.fail(c))
    assert strict["objective"] is None
    again = read_solution(tmp_path / "s.json").answer
    assert (again.found, again.reason, len(again.path)) == (False, "no facets fit", 0)


SPOILED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "unknown status": (("status",), "perfect", "status"),
    "a knot missing": (("path",), [[[0, 0]] * 4] * 2, "path: expected a list of 3"),
    "a finger missing": (("path", 0), [[0, 0]] * 3, r"path\[0\]"),
    "nan": (("path", 0, 0, 0), math.nan, r"path\[0\]\[0\]\[0\]"),
    "facet of none": (("facets", 0), 4, r"facets\[0\]"),
    "true facet": (("facets", 0), True, r"facets\[0\]"),
    "three facets": (("facets",), [0, 1, 2], "facets"),
    "start in space": (("starts", 0), [1, 2, 3], r"starts\[0\]"),
    "unknown key": (("proof",), "trust me", "proof"),
}


@pytest.mark.parametrize(("path", "value", "message"), SPOILED.values(), ids=SPOILED)
def test_a_malformed_solution_is_refused_by_field(
    path: tuple[Any, ...], value: Any, message: str, tmp_path: Path
) -> None:
    write_solution(tmp_path / "s.json", problem_of(grasp_file()), made_up_answer(np.random.default_rng(0)))
    solution = json.loads((tmp_path / "s.json").read_text())
    solution_of(copy.deepcopy(solution))
    here = solution
    for key in path[:-1]:
        here = here[key]
    here[path[-1]] = value
    with pytest.raises(InvalidProblem, match=message) as caught:
        solution_of(solution)
    assert "\n" not in str(caught.value)
