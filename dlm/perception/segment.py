"""One object per frame, whole and in view: where it is."""

from dataclasses import dataclass

import cv2
import numpy as np

from dlm.perception.appearance import Appearance
from expert.errors import InvalidProblem
from expert.geometry.pose import Array

SMALLEST = 12
"""Fewest pixels that make an object."""
MARGIN = 4
"""Pixels around the object that are looked at; more where the image is blurred."""
RIVAL = 0.15
"""A second piece of this share of the object's area is another object."""


@dataclass(frozen=True)
class Windows:
    """Parts of the frames around the object: origins (T, 2) of windows of one size, and the object's pixels in the frames."""

    origins: np.ndarray
    height: int
    width: int
    masks: np.ndarray

    def cut(self, images: Array) -> Array:
        """(T, H, W) to (T, height, width)."""
        return np.stack(
            [
                image[y : y + self.height, x : x + self.width]
                for image, (x, y) in zip(images, self.origins, strict=True)
            ]
        )


def segment(look: Appearance, margin: int = MARGIN) -> Windows:
    """The object's pixels.  Raises InvalidProblem for several objects, or one that is not wholly in view in every frame."""
    masks = np.stack([_one_object(look, t) for t in range(len(look.share))])
    areas = masks.sum(axis=(1, 2))
    for t, mask in enumerate(masks):
        border = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
        if border or areas[t] < 0.3 * np.median(areas):
            raise InvalidProblem(
                "video",
                expected="the whole object inside every frame",
                got=f"one that leaves frame {t}",
                remedy="move the camera back or cut the clip",
            )
    return _windows(masks, margin)


def _one_object(look: Appearance, t: int) -> np.ndarray:
    thing = (look.share[t] > 0.5) & ~look.foreign[t]
    if thing.sum() < SMALLEST:
        raise InvalidProblem(
            "video",
            expected="an object in every frame",
            got=f"background only in frame {t}",
            remedy="show the object in every frame",
        )
    # What something in front covers may connect two visible parts of one object.
    _, pieces = cv2.connectedComponents((thing | look.foreign[t]).astype(np.uint8), connectivity=8)
    areas = np.bincount(pieces[thing], minlength=pieces.max() + 1)
    order = np.argsort(areas)[::-1]
    if len(order) > 1 and areas[order[1]] > max(SMALLEST, RIVAL * areas[order[0]]):
        raise InvalidProblem(
            "video",
            expected="one object",
            got=f"{int((areas > max(SMALLEST, RIVAL * areas.max())).sum())} separate ones in frame {t}",
            remedy="leave one object in view",
        )
    return thing & (pieces == order[0])


def _windows(masks: np.ndarray, margin: int) -> Windows:
    boxes = []
    for mask in masks:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        boxes.append((columns[0], rows[0], columns[-1] + 1, rows[-1] + 1))
    low, high = np.array(boxes)[:, :2], np.array(boxes)[:, 2:]
    limits = np.array(masks.shape[:0:-1])
    width, height = np.minimum((high - low).max(axis=0) + 2 * margin, limits)
    origins = np.clip((low + high - [width, height]) // 2, 0, limits - [width, height])
    return Windows(origins, int(height), int(width), masks)
