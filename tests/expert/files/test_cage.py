"""Properties of bad cage files: whatever is wrong is refused in one line that names the field, with exit 2, destroying nothing."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from expert.__main__ import main
from expert.errors import InvalidProblem
from expert.files import problem_of
from expert.geometry.convex import convex_pieces
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, to_world
from expert.problems.cage import Arrangement, CageProblem
from tests.support.polygons import random_nonconvex_polygon, random_polygon

several = settings(
    max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True
)
SEEDS = st.integers(0, 10**6)
NUMBERS = st.floats(-0.2, 0.2) | st.floats(-1e6, 1e6) | st.sampled_from([0, 1e-12, 1e9, 1e308, float("nan")])
JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 5) | NUMBERS | st.text(max_size=5) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


def cage_file(vertices: Array, **changes: Any) -> dict[str, Any]:
    base = {
        "schema": 1,
        "problem": "cage",
        "object": {"vertices": vertices.tolist()},
        "pose": [0.1, -0.2, 0.7],
        "fingers": {"count": 3},
        "options": {"rotation": [15, [5, 20]], "time_limit": 10, "margin": 0.002},
    }
    return {**base, **changes}


def refusal(data: dict[str, Any]) -> str:
    with pytest.raises(InvalidProblem) as caught:
        problem_of(data)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def pocketed(seed: int) -> Array:
    return random_nonconvex_polygon(np.random.default_rng(seed), 5 + seed % 5)


@several
@given(SEEDS, st.integers(0, 99))
def test_a_missing_piece_is_noticed(seed: int, which: int) -> None:
    vertices = pocketed(seed)
    pieces = [piece.tolist() for piece in convex_pieces(vertices)]
    problem_of(cage_file(vertices, object={"vertices": vertices.tolist(), "pieces": pieces}))
    del pieces[which % len(pieces)]
    said = refusal(cage_file(vertices, object={"vertices": vertices.tolist(), "pieces": pieces}))
    assert said.startswith("object.pieces: ")
    assert "do not cover" in said


@several
@given(SEEDS, st.integers(0, 99), st.floats(0, 2 * np.pi), st.floats(1e-4, 0.2))
def test_a_displaced_piece_is_noticed(seed: int, which: int, angle: float, far: float) -> None:
    vertices = pocketed(seed)
    pieces = convex_pieces(vertices)
    pieces[which % len(pieces)] = pieces[which % len(pieces)] + far * np.array([np.cos(angle), np.sin(angle)])
    listed = {"vertices": vertices.tolist(), "pieces": [piece.tolist() for piece in pieces]}
    said = refusal(cage_file(vertices, object=listed))
    assert said.startswith("object.pieces: ")
    assert "outside" in said or "do not cover" in said


@several
@given(SEEDS, st.floats(1.05, 5.0))
def test_pieces_that_fall_apart_are_noticed(seed: int, spread: float) -> None:
    pieces = convex_pieces(pocketed(seed))
    apart = [(piece + 2 * k * spread * np.array([0.1, 0.0])).tolist() for k, piece in enumerate(pieces)]
    assert "do not join" in refusal(cage_file(np.zeros((0, 2)), object={"pieces": apart}))


@several
@example(3, 0.9, 1.0)
@example(3, 0.02, 5.585983599711722)
@given(st.integers(3, 9), st.floats(0.02, 0.9), st.floats(0, 2 * np.pi))
def test_a_hole_is_noticed(corners: int, inner: float, turn: float) -> None:
    angles = turn + 2 * np.pi * np.arange(corners) / corners
    outside = 0.05 * np.column_stack([np.cos(angles), np.sin(angles)])
    ahead = np.roll(outside, -1, axis=0)
    ring = [
        [a.tolist(), b.tolist(), (inner * b).tolist(), (inner * a).tolist()]
        for a, b in zip(outside, ahead, strict=True)
    ]
    assert "1 hole(s)" in refusal(cage_file(outside, object={"pieces": ring}))
    core = (inner * outside).tolist()
    assert isinstance(problem_of(cage_file(outside, object={"pieces": [*ring, core]})).task, CageProblem)


@several
@given(SEEDS, st.integers(0, 2), st.booleans())
def test_a_finger_inside_the_object_is_named(seed: int, which: int, fixed: bool) -> None:
    rng = np.random.default_rng(seed)
    vertices = random_polygon(rng, 4 + seed % 7)
    x = rng.uniform(-0.05, 0.05, (200, 2))
    x = x[signed_distance(vertices, x) < -1e-4]
    assume(len(x) > 0)
    pose = np.array([0.1, -0.2, 0.7])
    fingers = to_world(pose, np.array([[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2]]))
    listed = np.insert(fingers, which, to_world(pose, x[:1]), axis=0).tolist()
    stated = {"count": 1, "fixed": listed} if fixed else {"positions": listed}
    data = cage_file(vertices, fingers=stated)
    if not fixed:
        del data["options"]
    field = f"fingers.{'fixed' if fixed else 'positions'}[{which}]"
    said = refusal(data)
    assert said.startswith(f"{field}: ")
    assert "inside" in said


@several
@given(SEEDS, st.integers(0, 1), st.booleans())
def test_one_finger_or_none_is_too_few(seed: int, count: int, stated: bool) -> None:
    vertices = random_polygon(np.random.default_rng(seed), 5)
    given_fingers = {"positions": [[9.0, 9.0]] * count} if stated else {"count": count}
    data = cage_file(vertices, fingers=given_fingers)
    if stated:
        del data["options"]
    said = refusal(data)
    assert said.startswith("fingers")
    assert "at least 2" in said


OUTSIDE = st.floats(-400, 0) | st.floats(180, 400)


@several
@given(OUTSIDE, st.floats(0.1, 179.9), st.booleans())
def test_an_empty_or_endless_range_of_rotation_is_refused(bad: float, good: float, below: bool) -> None:
    pair = [bad, good] if below else [good, bad]
    vertices = random_polygon(np.random.default_rng(0), 5)
    said = refusal(cage_file(vertices, options={"rotation": [[10, 10], pair]}))
    assert said.startswith("options.rotation: ")
    assert "around the pose" in said


@several
@given(st.floats(0, 1), st.floats(1e-6, 1))
def test_an_empty_range_of_opening_is_refused(most: float, excess: float) -> None:
    gripper = {"fingers": [0, 1], "opening": [most + excess, most]}
    vertices = random_polygon(np.random.default_rng(0), 5)
    said = refusal(cage_file(vertices, fingers={"count": 2, "grippers": [gripper]}))
    assert "least <= most" in said


def test_the_fewest_fingers_of_grippers_are_refused() -> None:
    vertices = random_polygon(np.random.default_rng(0), 5)
    gripper = {"fingers": [0, 1], "opening": [0.0, 0.1]}
    fingers = {"count": 2, "fewest": True, "grippers": [gripper]}
    assert refusal(cage_file(vertices, fingers=fingers)).startswith("fingers.fewest: ")
    assert refusal(cage_file(vertices, fingers={"count": 2, "fewest": 3})).startswith("fingers.fewest: ")


def paths_of(data: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in the nested data below the root."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path for key, value in items for path in [(*here, key), *paths_of(value, (*here, key))]]


FULL = cage_file(
    pocketed(3),
    fingers={
        "count": 2,
        "fixed": [[0.5, 0.5]],
        "grippers": [{"fingers": [0, 1], "opening": [0.0, 0.2]}],
        "parallel": True,
    },
    walls=[{"from": [-1.0, -0.5], "to": [1.0, -0.5]}],
    cost="min_separation",
)


@st.composite
def mutated_files(draw: st.DrawFn) -> dict[str, Any]:
    """A valid file with one or two places deleted, or replaced by numbers, junk, or what stands elsewhere in it."""
    data = copy.deepcopy(FULL)
    for _ in range(draw(st.integers(1, 2))):
        path = draw(st.sampled_from(paths_of(data)))
        parent = data
        for key in path[:-1]:
            parent = parent[key]
        if draw(st.integers(0, 3)):
            elsewhere = st.sampled_from(["walls", "pose", "fingers"]).map(
                lambda key: copy.deepcopy(FULL[key])
            )
            parent[path[-1]] = draw(NUMBERS | JUNK | elsewhere)
        else:
            del parent[path[-1]]
    return data


def outcome(data: dict[str, Any]) -> Arrangement | CageProblem | InvalidProblem:
    """The task that was read or the refusal; any other exception fails the test."""
    try:
        task: Arrangement | CageProblem = problem_of(data).task
    except InvalidProblem as refused:
        return refused
    return task


def test_malformed_files_are_refused_in_one_line_or_are_valid_problems() -> None:
    counts = {"read": 0, "refused": 0}

    @settings(max_examples=500, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(mutated_files())
    def reads_or_refuses(data: dict[str, Any]) -> None:
        result = outcome(data)
        if isinstance(result, InvalidProblem):
            assert result.field
            assert len(str(result).splitlines()) == 1
            assert len(str(result)) < 400
        else:
            assert np.isfinite(result.shape.vertices).all()
        counts["refused" if isinstance(result, InvalidProblem) else "read"] += 1

    reads_or_refuses()
    assert min(counts.values()) >= 30, counts


HOLLOW = [
    [[0, 0], [3, 0], [3, 1], [0, 1]],
    [[0, 2], [3, 2], [3, 3], [0, 3]],
    [[0, 0], [1, 0], [1, 3], [0, 3]],
    [[2, 0], [3, 0], [3, 3], [2, 3]],
]
BREAK: dict[str, Callable[[dict[str, Any]], None]] = {
    "hole": lambda d: d.update(
        object={"pieces": [[[0, 0], [1, 0], [0.9, 0.1], [0.1, 0.1]]] * 2 + [[[5, 5]]]}
    ),
    "inside": lambda d: d["fingers"].update(fixed=[d["pose"][:2]]),
    "few": lambda d: d.update(fingers={"count": 1}),
    "range": lambda d: d.update(options={"rotation": [[0, 0]]}),
}


@pytest.mark.parametrize("broken", BREAK)
@pytest.mark.parametrize("command", ["solve", "verify"])
def test_commands_exit_2_with_one_line_and_leave_files_alone(
    broken: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = cage_file(random_polygon(np.random.default_rng(1), 6), pose=[0.0, 0.0, 0.0])
    BREAK[broken](data)
    file, kept = tmp_path / "cage.json", tmp_path / "kept.json"
    file.write_text(json.dumps(data))
    kept.write_text("precious")
    assert main([command, str(file), "-o", str(kept)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert len(said.strip().splitlines()) == 1
    assert kept.read_text() == "precious"
