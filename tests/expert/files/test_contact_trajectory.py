"""Files of contact trajectories: what is accepted means what it says, and what is refused is refused in one line."""

import copy
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.files import problem_of, read_problem, read_solution, solution_of, write_solution
from expert.files.document import parse
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import to_world
from expert.problems.contact import FREE, SUPPORT, ContactTask, Plan
from expert.verify.plan.check import check_plan
from tests.support.hand_plans import LEFT, RIGHT, SQUARE, TOP, A, lifted_block, pushed_block, sliding_block

GALLERY = sorted(Path("configs/problem/contact_trajectory").glob("*.yaml"))
X = 0.01 * np.arange(5)


def sliding_file() -> dict[str, Any]:
    """The file of `sliding_block`, every key written out."""
    return {
        "schema": 1,
        "problem": "contact_trajectory",
        "description": "one finger slides a block",
        "object": {"vertices": copy.deepcopy(SQUARE), "mass": 0.01, "com": [0.0, 0.0], "inertia": 1e-3 / 60},
        "environment": {
            "plane": "sagittal",
            "gravity": 9.8,
            "walls": [{"point": [0.0, 0.0], "normal": [0.0, 1.0], "friction": 0.1}],
            "support_friction": 0.3,
        },
        "trajectory": {
            "dt": 0.1,
            "poses": [[float(x), A, 0.0] for x in X],
            "ends": "steady",
            "before": [-0.01, A, 0.0],
            "after": [0.05, A, 0.0],
        },
        "fingers": {"count": 1, "friction": 0.1, "max_force": 0.98, "facet_margin": 0.05, "clearance": 0.002},
        "cost": {"force": 1.0, "acceleration": 1.0, "margin": 0.0},
        "robustness": {
            "cone_fraction": 1.0,
            "support_inset": 0.0,
            "min_normal_force": 0.0,
            "min_interval": 1,
            "free_clearance": 0.0,
        },
        "options": {"gap": 1e-3, "time_limit": 60, "method": "exact", "node_limit": 1000},
    }


def at(data: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


def edited(path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    data = sliding_file()
    at(data, path[:-1])[path[-1]] = value
    return data


def without(*path: Any) -> dict[str, Any]:
    data = sliding_file()
    del at(data, path[:-1])[path[-1]]
    return data


def refusal(data: Any) -> str:
    with pytest.raises(InvalidProblem) as caught:
        problem_of(data)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# What is accepted


@pytest.mark.parametrize("path", GALLERY, ids=lambda p: p.stem)
def test_every_gallery_file_is_read(path: Path) -> None:
    problem = read_problem(path)
    assert problem.kind == "contact_trajectory"
    assert isinstance(problem.task, ContactTask)
    assert problem.options["gap"] == 1e-3


def test_a_file_means_what_it_says() -> None:
    problem = problem_of(sliding_file())
    task, (expected, _) = problem.task, sliding_block()
    np.testing.assert_allclose(task.body.vertices, expected.body.vertices)
    assert task.body.inertia == pytest.approx(expected.body.inertia)
    np.testing.assert_allclose(task.trajectory.extended, expected.trajectory.extended, atol=1e-15)
    np.testing.assert_array_equal(task.environment.walls[0].normal, [0, 1])
    assert (task.fingers, task.cost, task.robustness) == (
        expected.fingers,
        expected.cost,
        expected.robustness,
    )
    assert problem.options == {"gap": 1e-3, "time_limit": 60.0, "method": "exact", "node_limit": 1000}


def test_defaults_are_the_documented_ones() -> None:
    data = sliding_file()
    data = {key: data[key] for key in ("schema", "problem", "object", "environment", "trajectory", "fingers")}
    data["object"] = {key: data["object"][key] for key in ("vertices", "mass")}
    data["environment"] = {}
    data["trajectory"] = {key: data["trajectory"][key] for key in ("dt", "poses")}
    data["fingers"] = {"count": 3, "friction": 0.2}
    problem = problem_of(data)
    task = problem.task
    assert (task.environment.plane, task.environment.gravity, task.environment.walls) == (
        "sagittal",
        9.81,
        (),
    )
    assert task.environment.support_friction == 0.3
    assert task.fingers.max_force == pytest.approx(10 * 0.01 * 9.81)
    assert (task.fingers.facet_margin, task.fingers.clearance) == (0.05, 0.002)
    assert (task.cost.force, task.cost.acceleration, task.cost.margin) == (1, 1, 0)
    assert task.robustness.cone_fraction == 1
    np.testing.assert_allclose(task.trajectory.accelerations, 0, atol=1e-12)
    assert problem.options == {"gap": 1e-3, "time_limit": 60.0, "method": "exact", "node_limit": None}


def test_rest_ends_stop_the_object_outside_the_horizon() -> None:
    data = sliding_file()
    data["trajectory"] = {"dt": 0.1, "poses": data["trajectory"]["poses"], "ends": "rest"}
    acceleration = problem_of(data).task.trajectory.accelerations[:, 0]
    np.testing.assert_allclose(acceleration, [1, 0, 0, 0, -1], atol=1e-9)


def test_a_shifted_body_frame_changes_nothing_in_the_world() -> None:
    shift, data = np.array([0.03, -0.02]), sliding_file()
    turned = [[0.0, 0.3, 0.0], [0.01, 0.3, 0.4], [0.03, 0.32, 0.9]]
    data["trajectory"] = {"dt": 0.1, "poses": turned}
    del data["object"]["com"], data["object"]["inertia"]
    moved = copy.deepcopy(data)
    moved["object"]["vertices"] = (np.array(SQUARE) + shift).tolist()
    origin = [to_world(pose, -shift[None])[0].tolist() for pose in turned]
    moved["trajectory"]["poses"] = [[*xy, pose[2]] for xy, pose in zip(origin, turned, strict=True)]
    one, other = problem_of(data).task, problem_of(moved).task
    np.testing.assert_allclose(one.trajectory.extended, other.trajectory.extended, atol=1e-15)
    np.testing.assert_allclose(one.body.vertices, other.body.vertices, atol=1e-15)
    assert one.body.inertia == pytest.approx(other.body.inertia)


def test_a_stated_centre_of_mass_becomes_the_origin() -> None:
    data = edited(("object", "com"), [0.02, 0.01])
    del data["object"]["inertia"]
    task = problem_of(data).task
    np.testing.assert_allclose(task.body.vertices, np.array(SQUARE) - [0.02, 0.01])
    np.testing.assert_allclose(
        task.trajectory.poses[:, :2], np.column_stack([X + 0.02, np.full(5, A + 0.01)])
    )
    plate = mass_properties(np.array(SQUARE))
    uniform = 0.01 * (plate.second_moment / plate.area + 0.02**2 + 0.01**2)
    assert task.body.inertia == pytest.approx(uniform)


def test_wall_normals_may_have_any_length() -> None:
    wall = problem_of(edited(("environment", "walls", 0, "normal"), [0.0, 7.0])).task.environment.walls[0]
    np.testing.assert_array_equal(wall.normal, [0, 1])


def test_yaml_and_json_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(sliding_file()))
    (tmp_path / "a.json").write_text(json.dumps(sliding_file()))
    assert read_problem(tmp_path / "a.yaml").data == read_problem(tmp_path / "a.json").data == sliding_file()


# What is refused

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": (edited(("fingers", "cuont"), 1), "fingers.cuont: .* did you mean count"),
    "unknown section": (edited(("walls",), []), "walls: .* unknown key"),
    "self-crossing": (
        edited(("object", "vertices"), [[-A, -A], [A, A], [A, -A], [-A, A]]),
        "object.vertices: .* edges 0 and 2",
    ),
    "repeated vertex": (edited(("object", "vertices", 1), [-A, -A]), "object.vertices: .* vertex 0 repeated"),
    "two vertices": (edited(("object", "vertices"), [[0, 0], [1, 0]]), "object.vertices: .* 3 points"),
    "no area": (edited(("object", "vertices"), [[0, 0], [1, 0], [2, 0]]), "object.vertices"),
    "point object": (edited(("object", "vertices"), [[1, 1], [1, 1], [1, 1]]), "object.vertices: .* larger"),
    "start inside a wall": (
        edited(("trajectory", "poses", 0, 1), 0.04),
        r"trajectory.poses\[0\]: .* inside it",
    ),
    "one pose": (edited(("trajectory", "poses"), [[0, A, 0]]), "trajectory.poses: .* at least 2"),
    "no pose": (edited(("trajectory", "poses"), []), "trajectory.poses: .* at least 2"),
    "pose without angle": (
        edited(("trajectory", "poses", 2), [0, A]),
        r"trajectory.poses\[2\]: .* 3 numbers",
    ),
    "no mass": (without("object", "mass"), "object.mass: .* nothing"),
    "zero mass": (edited(("object", "mass"), 0), "object.mass: .* positive"),
    "negative mass": (edited(("object", "mass"), -0.01), "object.mass: .* positive"),
    "true mass": (edited(("object", "mass"), True), "object.mass: .* a number"),
    "quoted mass": (edited(("object", "mass"), "0.01"), "object.mass: .* remove the quotes"),
    "negative inertia": (edited(("object", "inertia"), -1e-5), "object.inertia"),
    "com outside": (edited(("object", "com"), [1.0, 0.0]), "object.com: .* inside"),
    "zero dt": (edited(("trajectory", "dt"), 0), "trajectory.dt: .* positive"),
    "nan": (edited(("trajectory", "poses", 1, 2), math.nan), r"trajectory.poses\[1\]\[2\]: .* nan"),
    "infinity": (edited(("fingers", "max_force"), math.inf), "fingers.max_force: .* inf"),
    "huge integer": (edited(("fingers", "max_force"), 10**400), "fingers.max_force: .* magnitude"),
    "zero friction": (edited(("fingers", "friction"), 0), "fingers.friction: .* positive"),
    "negative wall friction": (edited(("environment", "walls", 0, "friction"), -0.1), r"walls\[0\].friction"),
    "zero normal": (
        edited(("environment", "walls", 0, "normal"), [0, 0]),
        r"walls\[0\].normal: .* zero vector",
    ),
    "walls not a list": (edited(("environment", "walls"), {"point": [0, 0]}), "environment.walls: .* list"),
    "facet margin above a half": (edited(("fingers", "facet_margin"), 0.51), "facet_margin: .* 0 to 0.5"),
    "no finger": (edited(("fingers", "count"), 0), "fingers.count"),
    "half a finger": (edited(("fingers", "count"), 1.5), "fingers.count: .* whole number"),
    "no ends": (
        edited(("trajectory", "ends"), ""),
        "trajectory.ends: expected steady or rest, got ''",
    ),
    "another plane": (
        edited(("environment", "plane"), "frontal"),
        "environment.plane: .* sagittal or transverse",
    ),
    "another method": (edited(("options", "method"), "magic"), "options.method: .* exact or thesis or scip"),
    "gap of one": (edited(("options", "gap"), 1.0), "options.gap"),
    "cone fraction of zero": (edited(("robustness", "cone_fraction"), 0), "robustness.cone_fraction"),
    "interval of three": (edited(("robustness", "min_interval"), 3), "robustness.min_interval"),
    "schema of the future": (edited(("schema",), 2), "schema: expected 1, got 2"),
    "schema true": (edited(("schema",), True), "schema: expected 1"),
    "another kind": (edited(("problem",), "levitation"), "problem: expected contact_trajectory"),
    "no kind": (without("problem"), "problem: .* nothing"),
    "section of the wrong type": (edited(("fingers",), [1, 2]), "fingers: .* mapping"),
    "no section": (without("trajectory"), "trajectory: .* nothing"),
    "key over two lines": (edited(("a\nb",), 1), "a b: .* unknown key"),
}


@pytest.mark.parametrize(("data", "message"), REFUSED.values(), ids=REFUSED)
def test_bad_input_is_refused_by_field(data: dict[str, Any], message: str) -> None:
    assert re.search(message, line := refusal(data)), line


# Malformed files by the thousand

LEAVES = (
    st.none()
    | st.booleans()
    | st.integers(-3, 3)
    | st.integers()
    | st.sampled_from(
        [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e-300, 1e9, -1e9, 10**400, 0.5, 0.51]
    )
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["1e-3", "steady", "rest", "sagittal", "transverse", "exact"])
)
JUNK = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
NUMBERS = st.floats(-0.2, 0.2) | st.floats(-1e6, 1e6) | st.sampled_from([0, -0.0, 1e-9, 1e-12, 1e9])
POLYGONS = st.lists(st.lists(st.floats(-0.1, 0.1) | NUMBERS, min_size=2, max_size=2), min_size=2, max_size=7)
POSES = st.lists(st.lists(NUMBERS, min_size=3, max_size=3), max_size=4)


def paths_of(data: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in the nested data below the root."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    below = [(*here, key) for key, _ in items]
    return below + [path for key in below for path in paths_of(at(data, (key[-1],)), key)]


PLACES = paths_of(sliding_file())
Mutation = Callable[[dict[str, Any]], None]


@st.composite
def mutated_files(draw: st.DrawFn) -> dict[str, Any]:
    """A valid file after one to three mutations: keys deleted, added or replaced, polygons and poses redrawn."""
    data = sliding_file()
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(PLACES))
        try:
            parent, key = at(data, path[:-1]), path[-1]
            parent[key]
        except (KeyError, IndexError, TypeError):
            continue  # an earlier mutation took it away
        match draw(st.sampled_from(["delete", "junk", "number", "add", "polygon", "poses", "duplicate"])):
            case "delete":
                del parent[key]
            case "junk":
                parent[key] = draw(JUNK)
            case "number":
                parent[key] = draw(NUMBERS)
            case "add" if isinstance(parent, dict):
                parent[draw(st.text(max_size=8))] = draw(JUNK)
            case "polygon" if isinstance(data.get("object"), dict):
                data["object"]["vertices"] = draw(POLYGONS)
            case "poses" if isinstance(data.get("trajectory"), dict):
                data["trajectory"]["poses"] = draw(POSES)
            case "duplicate" if isinstance(parent, list):
                parent.append(copy.deepcopy(parent[key]))
    return data


def outcome(read: Callable[[], Any]) -> ContactTask | InvalidProblem:
    """The task that was read or the refusal; any other exception passes through and fails the test."""
    try:
        task: ContactTask = read().task
    except InvalidProblem as refused:
        return refused
    return task


def test_thousands_of_malformed_files_are_refused_in_one_line_or_are_valid_tasks() -> None:
    counts = {"read": 0, "refused": 0}

    @settings(max_examples=2500, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(mutated_files())
    def reads_or_refuses(data: dict[str, Any]) -> None:
        result = outcome(lambda: problem_of(data))
        if isinstance(result, InvalidProblem):
            assert result.field
            assert result.expected
            assert result.got
            assert len(str(result).splitlines()) == 1
            assert len(str(result)) < 400
        else:
            assert result.steps >= 2
            assert np.isfinite(result.trajectory.accelerations).all()
            assert 0 < result.body.mass < np.inf
            assert 0 < result.body.inertia < np.inf
        counts["refused" if isinstance(result, InvalidProblem) else "read"] += 1

    reads_or_refuses()
    # Mutations that all passed, or all failed at the first key, would show little.
    assert sum(counts.values()) >= 2000
    assert min(counts.values()) >= 100, counts


@settings(max_examples=500, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(st.data())
def test_garbled_text_is_refused_in_one_line_or_read(data: st.DataObject) -> None:
    """Characters cut out of, and put into, the text of a valid file."""
    text = data.draw(st.sampled_from([yaml.safe_dump(sliding_file()), json.dumps(sliding_file())]))
    start = data.draw(st.integers(0, len(text)))
    stop = data.draw(st.integers(start, min(len(text), start + 30)))
    garbled = text[:start] + data.draw(st.text(max_size=10)) + text[stop:]
    for json_only in (False, True):
        result = outcome(lambda json_only=json_only: problem_of(parse(garbled, json_only=json_only)))
        assert isinstance(result, ContactTask) or len(str(result).splitlines()) == 1


# Solutions


def solved_file(made: Callable[[], tuple[ContactTask, Plan]]) -> tuple[dict[str, Any], Plan]:
    task, plan = made()
    data = sliding_file()
    data["fingers"]["count"] = task.fingers.count
    data["environment"]["plane"] = task.environment.plane
    data["environment"]["walls"] = data["environment"]["walls"] if task.environment.walls else []
    poses = task.trajectory.poses.tolist()
    data["trajectory"] = {"dt": 0.1, "poses": poses}
    return data, plan


@pytest.mark.parametrize("made", [sliding_block, lifted_block, pushed_block])
def test_a_solution_survives_writing_and_reading(made: Any, tmp_path: Path) -> None:
    data, plan = solved_file(made)
    problem = problem_of(data)
    write_solution(tmp_path / "s.json", problem, plan)
    again = read_solution(tmp_path / "s.json")
    assert again.problem.data == data
    np.testing.assert_array_equal(again.answer.modes, plan.modes)
    np.testing.assert_array_equal(again.answer.positions, plan.positions)
    np.testing.assert_array_equal(again.answer.forces, plan.forces)
    assert len(again.answer.contact_forces) == len(plan.contact_forces)
    for one, other in zip(again.answer.contact_forces, plan.contact_forces, strict=True):
        assert (one.step, one.vertex, one.wall) == (other.step, other.vertex, other.wall)
        np.testing.assert_array_equal(one.force, other.force)
    assert (again.answer.objective, again.answer.bound) == (plan.objective, plan.bound)
    assert check_plan(again.problem.task, again.answer).verdict == "sound"


def test_solution_files_hold_neither_nan_nor_infinity(tmp_path: Path) -> None:
    problem = problem_of(sliding_file())
    write_solution(tmp_path / "s.json", problem, Plan(status="infeasible", bound=np.inf, reason="step 0"))
    strict = json.loads((tmp_path / "s.json").read_text(), parse_constant=lambda c: pytest.fail(c))
    assert list(strict)[:4] == ["schema", "solution", "problem", "status"]
    assert strict["objective"] is None
    answer = read_solution(tmp_path / "s.json").answer
    assert (answer.status, answer.reason, answer.found) == ("infeasible", "step 0", False)


def test_a_clockwise_file_gets_its_own_numbering_back(tmp_path: Path) -> None:
    """The same block listed the other way round: its solution file names facets and vertices of that list."""
    data, plan = solved_file(sliding_block)
    data["object"]["vertices"] = SQUARE[::-1]  # top left, top right, bottom right, bottom left
    problem = problem_of(data)
    # Its first vertex is kept, so the package's numbering starts at the top left corner, counter-clockwise.
    renamed = {TOP: 3, LEFT: 0, RIGHT: 2}
    corner = {0: 1, 1: 2}
    contacts = tuple(replace(c, vertex=corner[c.vertex]) for c in plan.contact_forces)
    plan = replace(plan, modes=np.full((5, 1), renamed[LEFT]), contact_forces=contacts)
    assert check_plan(problem.task, plan).verdict == "sound"
    write_solution(tmp_path / "s.json", problem, plan)
    written = json.loads((tmp_path / "s.json").read_text())
    assert written["modes"] == [[3]] * 5  # in the list, facet 3 runs from bottom left to top left
    assert {c["vertex"] for c in written["contact_forces"]} == {2, 3}
    for c in written["contact_forces"]:
        x, y, _ = data["trajectory"]["poses"][c["step"]]
        np.testing.assert_allclose(c["point"], np.array(data["object"]["vertices"][c["vertex"]]) + [x, y])
    assert check_plan(problem.task, read_solution(tmp_path / "s.json").answer).verdict == "sound"


SPOILED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "unknown status": (("status",), "perfect", "status"),
    "mode of no facet": (("modes", 0, 0), 4, r"modes\[0\]"),
    "true mode": (("modes", 0, 0), True, r"modes\[0\]"),
    "step missing": (("modes",), [[3]], "modes"),
    "nan force": (("finger_forces", 0, 0, 0), math.nan, r"finger_forces\[0\]\[0\]\[0\]"),
    "two fingers": (("finger_positions", 0), [[0, 0], [0, 0]], r"finger_positions\[0\]"),
    "vertex of none": (("contact_forces", 0, "vertex"), 4, r"contact_forces\[0\].vertex"),
    "wall of none": (("contact_forces", 0, "wall"), 1, r"contact_forces\[0\].wall"),
    "step of none": (("contact_forces", 0, "step"), -1, r"contact_forces\[0\].step"),
    "unknown key": (("proof",), "trust me", "proof"),
    "no problem": (("problem",), None, "problem"),
    "another solution": (("solution",), "levitation", "solution"),
    "bad problem inside": (("problem", "object", "mass"), 0, "object.mass"),
}


@pytest.mark.parametrize(("path", "value", "message"), SPOILED.values(), ids=SPOILED)
def test_a_malformed_solution_is_refused_by_field(
    path: tuple[Any, ...], value: Any, message: str, tmp_path: Path
) -> None:
    data, plan = solved_file(sliding_block)
    write_solution(tmp_path / "s.json", problem_of(data), plan)
    solution = json.loads((tmp_path / "s.json").read_text())
    solution_of(copy.deepcopy(solution))
    at(solution, path[:-1])[path[-1]] = value
    with pytest.raises(InvalidProblem, match=message) as caught:
        solution_of(solution)
    assert "\n" not in str(caught.value)


def test_contact_forces_without_a_point_act_at_their_vertex(tmp_path: Path) -> None:
    data, plan = solved_file(pushed_block)
    write_solution(tmp_path / "s.json", problem_of(data), plan)
    solution = json.loads((tmp_path / "s.json").read_text())
    for contact in solution["contact_forces"]:
        del contact["point"]
    again = solution_of(solution)
    assert again.answer.contact_forces[0].wall == SUPPORT
    assert FREE in again.answer.modes
    assert check_plan(again.problem.task, again.answer).verdict == "sound"
