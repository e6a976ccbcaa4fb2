"""Does the camera stand still?  What does not belong to the object must stay where it is."""

import cv2
import numpy as np
from scipy import ndimage

from datasets.render import Frames
from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array

FINEST = 240
"""Side of the picture that is looked at, at most [pixels]."""
SMOOTH = 1.0
"""Blur before slopes are taken [pixels]."""
STEEP = 3.0
"""Grey levels per pixel from which an edge shows a shift."""
PASSES = 12
SMALLEST = 0.02
"""Steps that change nothing any more [pixels]."""
OUTLIER = 8.0
"""Grey levels beyond which a difference is something that moves by itself."""
EXPLAINED = 0.5
"""A shift counts where it removes so much of the squared differences."""

WIDE = 0.5
"""What moves over more than this share of the picture is the picture."""


def camera_shift(frames: Frames, ours: NDArrayBool) -> float:
    """How far the surroundings move from the first frame to any other, at most [pixels]; 0 where nothing shows it.

    ours (h, w): the pixels of the object, and about it, in any of the frames.
    """
    shrink = max(1.0, max(frames.shape[1:3]) / FINEST)
    size = round(frames.shape[2] / shrink), round(frames.shape[1] / shrink)
    small = [cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in frames]
    grey = ndimage.gaussian_filter(np.mean(small, axis=-1), (0, SMOOTH, SMOOTH))
    elsewhere = cv2.resize(ours.astype(np.uint8), size, interpolation=cv2.INTER_AREA) == 0
    shifts = [_shift(grey[0], other, elsewhere) for other in grey[1:]]
    return shrink * max((float(np.hypot(*shift)) for shift in shifts), default=0.0)


def _shift(first: Array, other: Array, where: NDArrayBool) -> Array:
    """Rows and columns by which `other` is displaced: Gauss-Newton, robust against what moves by itself."""
    slopes = np.moveaxis(np.array(np.gradient(first)), 0, -1)
    seen = where & (np.linalg.norm(slopes, axis=-1) > STEEP)
    if not seen.any():
        return np.zeros(2)
    shift = np.zeros(2)
    for _ in range(PASSES):
        error = _difference(first, other, shift)[seen]
        weight = 1 / (1 + (error / OUTLIER) ** 2)
        pull = slopes[seen] * weight[:, None]
        matrix = pull.T @ slopes[seen]
        # Along an edge nothing is seen to move.
        step = np.linalg.solve(matrix + 1e-2 * np.trace(matrix) * np.eye(2), pull.T @ error)
        shift = shift - step
        if np.abs(step).max() < SMALLEST:
            break
    before, after = (np.square(_difference(first, other, s)) * seen for s in (0 * shift, shift))
    explained = np.argwhere(after < 0.5 * before - OUTLIER**2)
    wide = len(explained) > 0 and (np.ptp(explained, axis=0) > WIDE * np.array(first.shape)).any()
    return shift if wide and after.sum() < EXPLAINED * before.sum() else np.zeros(2)


def _difference(first: Array, other: Array, shift: Array) -> Array:
    """`other` moved back by the shift, less the first."""
    return np.asarray(ndimage.shift(other, -shift, order=1, mode="nearest") - first)
