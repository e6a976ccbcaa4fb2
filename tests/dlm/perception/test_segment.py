import numpy as np
import pytest

from dlm.perception.appearance import Appearance
from dlm.perception.segment import segment
from expert.errors import InvalidProblem

SIZE = 40


def look(
    *boxes: tuple[slice, slice], frames: int = 2, foreign: tuple[slice, slice] | None = None
) -> Appearance:
    """The boxes are the object's in every frame, `foreign` is in front of it."""
    share = np.zeros((frames, SIZE, SIZE))
    for rows, columns in boxes:
        share[:, rows, columns] = 1.0
    hidden = np.zeros(share.shape, dtype=bool)
    if foreign:
        hidden[:, foreign[0], foreign[1]] = True
    return Appearance(share, np.ones_like(share), hidden, 1.0, np.full((SIZE, SIZE), 100.0))


BOX = (slice(10, 20), slice(12, 26))


def test_windows_hold_the_object_with_a_margin() -> None:
    windows = segment(look(BOX), margin=3)
    assert windows.masks.sum() == 2 * 10 * 14
    assert (windows.height, windows.width) == (16, 20)
    assert windows.origins.tolist() == [[9, 7], [9, 7]]
    assert windows.cut(windows.masks)[0, 3:13, 3:17].all()


def test_two_objects_are_refused_and_a_speck_is_not_one() -> None:
    second = (slice(28, 34), slice(5, 15))
    with pytest.raises(InvalidProblem, match="expected one object, got 2 separate ones in frame 0"):
        segment(look(BOX, second))
    speck = (slice(30, 32), slice(30, 32))
    assert segment(look(BOX, speck)).masks.sum() == 2 * 10 * 14


def test_pieces_that_something_in_front_joins_are_one_object() -> None:
    left, right = (slice(10, 20), slice(8, 16)), (slice(10, 20), slice(20, 28))
    with pytest.raises(InvalidProblem, match="expected one object"):
        segment(look(left, right))
    joined = segment(look(left, right, foreign=(slice(5, 25), slice(16, 20))))
    assert joined.masks.sum() == 2 * (80 + 80)


@pytest.mark.parametrize("edge", [(slice(0, 9), BOX[1]), (BOX[0], slice(30, SIZE))])
def test_an_object_at_the_edge_is_not_wholly_in_view(edge: tuple[slice, slice]) -> None:
    with pytest.raises(InvalidProblem, match="the whole object inside every frame"):
        segment(look(edge))


def test_an_object_that_shrinks_to_a_part_of_itself_leaves() -> None:
    seen = look(BOX, frames=3)
    seen.share[2, :, 15:] = 0
    with pytest.raises(InvalidProblem, match="leaves frame 2"):
        segment(seen)
    seen.share[2] = 0
    with pytest.raises(InvalidProblem, match="background only in frame 2"):
        segment(seen)
