"""What a cage problem refuses, in one line that names the field, and what it accepts."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.files import problem_of
from expert.problems.cage import Arrangement, CageProblem
from expert.world.fingers import Gripper
from expert.world.shape import Shape
from tests.support.polygons import random_nonconvex_polygon, random_polygon

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
LEFT, RIGHT = [[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]
FRAME = [
    [[0, 0], [3, 0], [3, 1], [0, 1]], [[0, 2], [3, 2], [3, 3], [0, 3]],
    [[0, 0], [1, 0], [1, 3], [0, 3]], [[2, 0], [3, 0], [3, 3], [2, 3]],
]  # fmt: skip


def stated(**changes: Any) -> dict[str, Any]:
    """A file that states a square among two fingers, with changes; None removes a key."""
    base = {
        "schema": 1,
        "problem": "cage",
        "object": {"vertices": SQUARE},
        "fingers": {"positions": [[-0.5, 0.5], [1.5, 0.5]]},
    }
    return {key: value for key, value in {**base, **changes}.items() if value is not None}


def search(**fingers: Any) -> dict[str, Any]:
    return stated(fingers={"count": 2, **fingers})


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (stated(object={"vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}), "object.vertices: .*cross"),
        (stated(object={"vertices": [[0, 0], [1, 0]]}), "object.vertices: "),
        (stated(object={"vertices": [[0, 0], [1e-12, 0], [0, 1e-12]]}), "object.vertices: .*smaller"),
        (stated(object={"pieces": []}), "object.pieces: .*none"),
        (stated(object={"pieces": FRAME}), "object.pieces: .*hole"),
        (stated(object={"pieces": [LEFT, [[3, 0], [4, 0], [4, 1]]]}), "object.pieces: .*do not join"),
        (stated(object={"pieces": [LEFT, [[1, 1], [2, 1], [2, 2]]]}), "object.pieces: .*do not join"),
        (stated(object={"pieces": [[[0, 0], [2, 0], [0.5, 0.5], [0, 2]]]}), r"object.pieces\[0\]: .*convex"),
        (stated(object={"vertices": SQUARE, "pieces": [LEFT, RIGHT]}), "object.pieces: .*outside"),
        (
            stated(object={"vertices": SQUARE, "pieces": [[[0, 0], [1, 0], [1, 1]]]}),
            "object.pieces: .*not cover",
        ),
        (stated(object={"vertices": SQUARE, "pieces": 3}), "object.pieces: "),
        (stated(fingers={"positions": [[-0.5, 0.5]]}), "fingers.positions: .*at least 2"),
        (stated(fingers={"positions": []}), "fingers.positions: .*at least 2"),
        (stated(fingers={"positions": [[0.5, 0.5], [2, 2]]}), r"fingers.positions\[0\]: .*inside"),
        (stated(fingers={"positions": [[2, 2], ["a", 2]]}), r"fingers.positions\[1\]\[0\]: "),
        (stated(fingers={"positions": [[2, 2], [3, 2]], "count": 2}), "fingers.count: "),
        (stated(fingers={"positions": [[2, 2], [3, 2]]}, cost="none"), "cost, options"),
        (stated(pose=[0, 0]), "pose: "),
        (stated(pose=[0, 0, float("nan")]), r"pose\[2\]: "),
        (stated(pose=[-1.0, 0, 0]), r"fingers.positions\[0\]: .*inside"),
        (stated(walls=[{"from": [-1, 0.5], "to": [2, 0.5]}]), r"walls\[0\]: .*enters"),
        (stated(walls=[{"from": [-1, 3], "to": [-1, 3]}]), r"walls\[0\]: .*point"),
        (stated(walls=[{"from": [-1, 3]}]), r"walls\[0\].to: "),
        (stated(finger={}), "finger: .*did you mean fingers"),
        (stated(fingers=None), "fingers: "),
        (search(count=1), "fingers: .*at least 2"),
        (search(count=-1), "fingers.count: "),
        (search(count=2.5), "fingers.count: "),
        (search(fixed=[[0.5, 0.5]]), r"fingers.fixed\[0\]: .*inside"),
        (search(grippers=[{"fingers": [0, 2], "opening": [0, 1]}]), "fingers.grippers: .*0 to 1"),
        (search(grippers=[{"fingers": [0, 0], "opening": [0, 1]}]), "grippers.fingers: .*different"),
        (search(grippers=[{"fingers": [0, 1], "opening": [2, 1]}]), "grippers.opening: .*least <= most"),
        (search(grippers=[{"fingers": [0, 0.5], "opening": [2, 1]}]), "fingers.*: .*indices"),
        (search(parallel="yes"), "fingers.parallel: "),
        (search(direction=10), "fingers.direction: .*parallel"),
        (search(direction="x", parallel=True), "fingers.direction: "),
        ({**search(), "cost": "least"}, "cost: "),
        ({**search(count=4), "cost": "max_opening"}, "cost: .*4 fingers"),
        ({**search(fewest=True), "cost": "max_opening"}, "cost: .*or fewer"),
        ({**search(), "options": {"margin": 0.5}}, "options.margin: "),
        ({**search(), "options": {"rotation": []}}, "options.rotation: "),
        ({**search(), "options": {"rotation": [0]}}, "options.rotation: .*around the pose"),
        ({**search(), "options": {"rotation": [[10, -10]]}}, "options.rotation: .*around the pose"),
        ({**search(), "options": {"rotation": [200]}}, "options.rotation: "),
        ({**search(), "options": {"time_limit": 0}}, "options.time_limit: "),
        ({**search(), "options": {"method": "magic"}}, "options.method: "),
    ],
)
def test_bad_input_is_one_line_that_names_the_field(data: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}") as caught:
        problem_of(data)
    assert "\n" not in str(caught.value)


def test_files_of_both_forms_are_read() -> None:
    given = problem_of(stated(walls=[{"from": [-1, 3], "to": [2, 3]}], pose=[0.1, 0, 0.1])).task
    assert isinstance(given, Arrangement)
    assert given.wall_ends.shape == (1, 2, 2)
    sought = problem_of({**search(fixed=[[3, 3]]), "options": {"rotation": [15, [5, 20]]}}).task
    assert isinstance(sought, CageProblem)
    assert np.degrees(sought.rotation) == pytest.approx(np.array([[15, 15], [5, 20]]))


def test_touching_fingers_are_accepted() -> None:
    a = Arrangement(
        shape=Shape(vertices=np.array(SQUARE)), pose=np.zeros(3), fingers=np.array([[0, 0.5], [1.0, 0.5]])
    )
    assert len(a.fingers) == 2


def test_a_gripper_must_name_searched_fingers() -> None:
    with pytest.raises(InvalidProblem, match="grippers"):
        CageProblem(
            shape=Shape(vertices=np.array(SQUARE)),
            pose=np.zeros(3),
            count=2,
            grippers=(Gripper(fingers=(0, 5), opening=(0, 1)),),
        )


def test_random_polygons_are_reproducible_and_as_asked() -> None:
    first, again = (random_polygon(np.random.default_rng(5), 9) for _ in range(2))
    assert (first == again).all()
    assert len(Shape(vertices=first).vertices) == 9
    pocketed = random_nonconvex_polygon(np.random.default_rng(5), 6)
    assert len(Shape(vertices=pocketed).pieces) >= 2
