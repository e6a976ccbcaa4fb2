"""Dead ends in closed form, as true local maxima, against executions, and on moved, mirrored and scaled copies."""

import numpy as np
import pytest

from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.grasping.sweeping import sweep
from expert.verify.grasp.dead_ends import DeadEndEvent, dead_end_events
from expert.verify.grasp.event_kernel import TOUCH
from expert.verify.grasp.finger_path import FingerPath
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.experiments import closing_path
from tests.support.grasps import closing_in, mirrored, moved, some_shape, turned
from tests.support.polygons import random_polygon

BOX = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
STILL = np.zeros(3)


def path_of(vertices: Array, knots: object, pose: Array = STILL) -> FingerPath:
    return FingerPath(Shape(vertices=vertices), pose, np.array(knots, dtype=float))


def angle_between(a: float, b: float) -> float:
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def test_two_fingers_squeeze_a_box_between_parallel_sides() -> None:
    path = path_of(BOX, [[[0.5, -3], [0.5, 3]], [[0.5, 0], [0.5, 0]]])  # 6 apart, then 0
    events = dead_end_events(path)
    assert len(events) == 4  # across the length and the width, either way round
    for event, gap in zip(events, [4, 4, 2, 2], strict=True):
        assert event.s == pytest.approx(1 - gap / 6, abs=1e-9)
        slide = np.linalg.norm(event.last - event.first) * path.frame.radius
        assert slide == pytest.approx(2 if gap == 4 else 4, abs=1e-5)  # along the sides that are touched


def test_fingers_that_only_open_make_no_dead_end() -> None:
    assert dead_end_events(path_of(BOX, [[[0.5, -1], [0.5, 1]], [[0.5, -3], [0.5, 3]]])) == []


def test_fingers_that_keep_a_side_to_side_grip_make_no_dead_end() -> None:
    knots = [[[0.5, -1], [0.5, 1]], [[0.6, -1], [0.6, 1]], [[0.5, -1], [0.5, 1]]]
    assert dead_end_events(path_of(BOX, knots)) == []


def test_three_fingers_close_on_a_triangle_where_its_normals_meet() -> None:
    corners = 2 * np.column_stack(
        [np.cos(a := np.pi * np.array([1 / 6, 5 / 6, 3 / 2])), np.sin(a)]
    )  # inradius 1
    toward = np.column_stack([np.cos(a := np.pi * np.array([1 / 2, 7 / 6, 11 / 6])), np.sin(a)])
    knots = np.array([[3 * toward], [0.5 * toward]])[:, 0]
    events = dead_end_events(path_of(corners, knots, np.array([0.3, 0, 0.1])))
    assert [e.s for e in events] == pytest.approx([2 / 2.5] * 3, abs=1e-9)
    assert all(len(e.contacts) == 3 for e in events)


def test_a_finger_in_a_reflex_corner_counts_as_two_contacts() -> None:
    notched = np.array([[-2.0, -1], [2, -1], [2, 1], [0.5, 1], [0, 0], [-0.5, 1], [-2, 1]])
    knots = [[[0.0, 2.0], [0.0, -2.0]], [[0.0, 0.2], [0.0, -0.2]]]
    pushed_in = [
        e for e in dead_end_events(path_of(notched, knots, np.array([5.0, 5, 0]))) if len(e.contacts) == 3
    ]
    fingers = {tuple(sorted(f for f, _ in e.contacts)) for e in pushed_in}
    assert fingers == {(0, 0, 1), (0, 1, 1)}
    assert [e.s for e in pushed_in] == pytest.approx(
        [(4 - 1) / 3.6] * 2, abs=1e-9
    )  # the corner is 1 above the base


def test_parallel_contacts_close_where_two_push_against_one() -> None:
    # Fingers 0, 1 rise together under the box, finger 2 comes down between them: the box cannot turn away.
    knots = [[[-1.0, -3], [1.0, -3.2], [0.0, 3]], [[-1.0, -0.5], [1.0, -0.7], [0.0, 0.5]]]
    events = [e for e in dead_end_events(path_of(BOX, knots)) if len(e.contacts) == 3]
    tilt = np.arctan2(-0.2, 2)
    tilted = [e for e in events if angle_between(float(e.first[2]), tilt) < 1e-6]
    height = 2 / np.cos(tilt)  # of the box above the middle of the lower fingers
    assert [e.s for e in tilted] == pytest.approx([(6.1 - height) / 5], abs=1e-9)


def test_more_dead_ends_than_can_be_listed_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    path = path_of(BOX, [[[0.5, -3], [0.5, 3]], [[0.5, 0], [0.5, 0]]])
    monkeypatch.setattr("expert.verify.grasp.dead_ends.MOST", 3)
    with pytest.raises(SolverFailed, match="more than 3 dead ends"):
        dead_end_events(path)


def test_nothing_near_a_dead_end_is_free_beyond_it() -> None:
    rng = np.random.default_rng(0)
    seen = 0
    for k in range(6):
        path = path_of(vertices := some_shape(rng, k), closing_in(vertices, rng, 3 + k % 2))
        for event in dead_end_events(path)[:20]:
            slide = float(np.linalg.norm(event.last - event.first))
            if event.s > path.last - 1e-3 or 0 < slide < 1e-5:
                continue  # facets that only their ends share are listed within the tolerance
            middle = event.inner_configurations(1)
            assert path.gap(middle, event.s)[0] >= -1e-6
            near = middle + 1e-4 * rng.uniform(-1, 1, (2000, 3))
            assert path.gap(near, event.s + 3e-4).max() < 0
            seen += 1
    assert seen >= 30


def test_every_stall_of_random_paths_is_a_listed_dead_end() -> None:
    rng = np.random.default_rng(1)
    stalls, paths = 0, 0
    while paths < 50:
        vertices = some_shape(rng, paths)
        path = path_of(vertices, closing_in(vertices, rng, 3 + paths % 2))
        events = dead_end_events(path)
        run = sweep(path.shape, path.knots_w, _free_starts(path, rng, 6))
        for k in np.flatnonzero(np.isfinite(run.stalled)):
            end = path.configurations(run.ends[k])[0]
            assert min((_off(e, float(run.stalled[k]), end) for e in events), default=np.inf) < 5e-3
            stalls += 1
        paths += 1
    assert stalls >= 50


@pytest.mark.parametrize("seed", [0, 6, 7, 24])
def test_objects_that_wait_at_a_strict_dead_end_stall_there(seed: int) -> None:
    shape, knots, _ = closing_path(seed)
    path = FingerPath(shape, STILL, knots)
    waiting = {True: 0, False: 0}
    for event in dead_end_events(path):
        place = event.inner_configurations(1)
        if path.deepest(place, 0.0, event.s)[0] > TOUCH:
            continue  # a finger moves it away before
        stalled = sweep(shape, knots, path.frame.world_pose(place)).stalled[0]
        waiting[event.strict] += 1
        assert not event.strict or stalled == pytest.approx(event.s, abs=1e-3)
    assert waiting[True] > 0
    assert (waiting[False] > 0) == (seed != 7)  # where facets would meet only at an end: some do not stall


def _free_starts(path: FingerPath, rng: np.random.Generator, count: int) -> Array:
    drawn = np.column_stack([rng.uniform(-0.4, 0.4, (300, 2)), rng.uniform(-np.pi, np.pi, 300)])
    return path.frame.world_pose(drawn[path.gap(drawn, 0.0) > 0][:count])


def _off(event: DeadEndEvent, s: float, end: Array) -> float:
    places = event.configurations(201)[:, :2]
    position = float(np.linalg.norm(places - end[:2], axis=1).min())
    return abs(event.s - s) + position + angle_between(float(event.first[2]), float(end[2]))


@pytest.mark.parametrize("k", range(3))
def test_moved_mirrored_and_scaled_copies_have_the_same_dead_ends(k: int) -> None:
    rng = np.random.default_rng(k)
    vertices = named_shape("T") if k == 0 else random_polygon(rng, 5 + k)
    knots, pose = closing_in(vertices, rng, 4), np.array([0.3, -2.0, 2.5])
    plain = [e.s for e in dead_end_events(path_of(vertices, knots))]
    copies = {
        "moved": path_of(vertices, moved(knots, pose), pose),
        "another body frame": path_of(turned(vertices, 0.7), knots, np.array([0.0, 0.0, -0.7])),
        "mirrored": path_of(mirrored(vertices)[::-1], mirrored(knots)),
        "scaled": path_of(1e-3 * vertices, 1e-3 * knots),
    }
    assert len(plain) > 0
    for name, copy in copies.items():
        assert [e.s for e in dead_end_events(copy)] == pytest.approx(plain, abs=1e-7), name
