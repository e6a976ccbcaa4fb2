"""Least squares on the colours of a frame: the pose that explains them, by Levenberg's method on differences."""

import numpy as np
from numba import njit

from dlm.control.picture import Pixels, paint, paint_disc
from expert.geometry.pose import Array
from expert.pushing.outline import Outline

NUDGE = np.array([0.5, 0.5, 0.008])
"""Differences, in pixels of the surface and rad."""
STEP = np.array([12.0, 12.0, 0.3])
DONE = 0.03
"""A fit ends when it moves by less than this fraction of the nudges."""


@njit(cache=True, error_model="numpy")
def fit_pose(
    edges: Outline,
    last: int,
    start: Array,
    pixels: Pixels,
    width: float,
    rounds: int,
    prior: Array,
    stiff: Array,
) -> tuple[Array, float]:
    """Pose (3,) near `start` of least squared colour error plus stiff . (pose - prior)^2, and the mean squared error."""
    n = len(pixels.places)
    pose, trial = start.copy(), start.copy()
    colours, probe = np.empty((n, 3)), np.empty((n, 3))
    slopes = np.empty((3, n, 3))
    paint(edges, last, pose, pixels, width, colours)
    cost, damping = _cost(colours, pixels.seen, pose, prior, stiff), 1e-2
    for _ in range(rounds):
        for k in range(3):
            trial[:] = pose
            trial[k] += NUDGE[k]
            paint(edges, last, trial, pixels, width, slopes[k])
        normal, right = _normal(slopes, colours, pixels.seen)
        for k in range(3):
            normal[k, k] += stiff[k] * NUDGE[k] ** 2
            right[k] += stiff[k] * NUDGE[k] * (pose[k] - prior[k])
        moved = 0.0
        for _ in range(6):
            step = (
                -np.linalg.solve(normal + damping * np.diag(np.diag(normal)) + 1e-6 * np.eye(3), right)
                * NUDGE
            )
            trial[:] = pose + np.minimum(np.maximum(step, -STEP), STEP)
            paint(edges, last, trial, pixels, width, probe)
            found = _cost(probe, pixels.seen, trial, prior, stiff)
            if found < cost:
                moved = np.max(np.abs(trial - pose) / NUDGE)
                pose[:], cost, damping = trial, found, damping / 5
                colours[:] = probe
                break
            damping *= 5
        if moved < DONE:
            break
    return pose, ((colours - pixels.seen) ** 2).sum() / max(n, 1)


@njit(cache=True, error_model="numpy")
def _cost(colours: Array, seen: Array, pose: Array, prior: Array, stiff: Array) -> float:
    total = (stiff * (pose - prior) ** 2).sum()
    for i in range(len(colours)):
        for d in range(3):
            total += (colours[i, d] - seen[i, d]) ** 2
    return total


@njit(cache=True, error_model="numpy")
def _normal(slopes: Array, colours: Array, seen: Array) -> tuple[Array, Array]:
    """Normal matrix (3, 3) and right side (3,) in units of the nudges."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for i in range(len(colours)):
        for d in range(3):
            for k in range(3):
                slope = slopes[k, i, d] - colours[i, d]
                if slope != 0.0:
                    right[k] += slope * (colours[i, d] - seen[i, d])
                    for j in range(k + 1):
                        normal[k, j] += slope * (slopes[j, i, d] - colours[i, d])
    for k in range(3):
        for j in range(k):
            normal[j, k] = normal[k, j]
    return normal, right


@njit(cache=True, error_model="numpy")
def fit_disc(radius: float, start: Array, pixels: Pixels, width: float, rounds: int) -> Array:
    """Centre (2,) near `start` of the disc that explains the colours best."""
    n = len(pixels.places)
    centre, trial = start.copy(), start.copy()
    colours, slope_x, slope_y = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    for _ in range(rounds):
        paint_disc(radius, centre, pixels, width, colours)
        trial[:] = centre
        trial[0] += 0.5
        paint_disc(radius, trial, pixels, width, slope_x)
        trial[0] -= 0.5
        trial[1] += 0.5
        paint_disc(radius, trial, pixels, width, slope_y)
        a, b, e = (slope_x - colours).ravel(), (slope_y - colours).ravel(), (colours - pixels.seen).ravel()
        aa, ab, bb = (a * a).sum() + 1e-6, (a * b).sum(), (b * b).sum() + 1e-6
        ra, rb = (a * e).sum(), (b * e).sum()
        determinant = aa * bb - ab * ab
        centre[0] -= 0.5 * min(max((bb * ra - ab * rb) / determinant, -6.0), 6.0)
        centre[1] -= 0.5 * min(max((aa * rb - ab * ra) / determinant, -6.0), 6.0)
    return centre
