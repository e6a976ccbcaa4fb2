"""Least squares between observed and modelled pixel coverage, over the polygon's vertices and its motion together."""

from dataclasses import dataclass, replace

import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dlm.perception.raster import coverage, is_simple
from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array

LONGEST_STEP = 1.0
"""No vertex moves further than this in one iteration [pixels]: the outline sees only the pixels that it crosses."""


LEAST_DAMPING = 1e-4
"""Corners that hardly bend the outline are free to slide along it: no step follows such a direction far."""
FAR = 0.3
"""Errors of coverage beyond this and the noise are due to something else than the outline."""


@dataclass(frozen=True)
class Observation:
    """Windows around the object: its share of each pixel (T, h, w), their weights (inverse variances), origins (T, 2)."""

    share: Array
    weight: Array
    origins: Array
    blur: float = 0.0


@dataclass(frozen=True)
class MovingPolygon:
    """vertices (V, 2) at step 0 [pixels]; motion (T, 3): turn about `centre`, then shift [pixels, pixels, rad]; motion[0] = 0."""

    vertices: Array
    motion: Array
    centre: Array

    def placed(self) -> Array:
        """Vertices at all steps, (T, V, 2) [pixels]."""
        return _place(self.vertices, self.motion, self.centre)

    def moved(self, step: Array) -> "MovingPolygon":
        """By parameters in the order of `derivative`."""
        count = self.vertices.size
        motion = self.motion.copy()
        motion[1:] += step[count:].reshape(-1, 3)
        return replace(self, vertices=self.vertices + step[:count].reshape(-1, 2), motion=motion)

    def seen_from_first_step(self) -> "MovingPolygon":
        """The same scene, described by the vertices' places at step 0."""
        return MovingPolygon(self.placed()[0], self.motion - self.motion[0], self.centre + self.motion[0, :2])

    def derivative(self) -> Array:
        """Of placed vertices with respect to all parameters: vertices, then motion[1:]; (T, V, 2, 2 V + 3 (T - 1))."""
        steps, count = len(self.motion), self.vertices.size
        out = np.zeros((steps, count, count + 3 * (steps - 1)))
        for t, angle in enumerate(self.motion[:, 2]):
            own = _frame(self.vertices - self.centre, angle)
            out[t, :, :count] = own[:, :count]
            if t > 0:
                out[t, :, count + 3 * (t - 1) : count + 3 * t] = own[:, count:]
        return out.reshape(steps, count // 2, 2, -1)


@numba.njit(cache=True)
def _place(vertices: Array, motion: Array, centre: Array) -> Array:
    placed = np.empty((len(motion), len(vertices), 2))
    for t in range(len(motion)):
        c, s = np.cos(motion[t, 2]), np.sin(motion[t, 2])
        for k in range(len(vertices)):
            x, y = vertices[k, 0] - centre[0], vertices[k, 1] - centre[1]
            placed[t, k, 0] = centre[0] + motion[t, 0] + c * x - s * y
            placed[t, k, 1] = centre[1] + motion[t, 1] + s * x + c * y
    return placed


@dataclass(frozen=True)
class Quadratic:
    """Half the weighted sum of squares at a scene, its gradient and Gauss-Newton matrix."""

    cost: float
    gradient: Array
    matrix: Array


def modelled(scene: MovingPolygon, seen: Observation) -> tuple[Array, Array]:
    """Coverage in the windows (T, h, w) and its gradient (T, h, w, V, 2) as the camera sees them."""
    share, gradient = coverage(scene.placed(), seen.origins, *seen.share.shape[1:])
    if seen.blur > 0:
        for axis in (1, 2):
            share = gaussian_filter1d(share, seen.blur, axis=axis)
            gradient = gaussian_filter1d(gradient, seen.blur, axis=axis)
    return share, gradient


def crossed(scene: MovingPolygon, seen: Observation) -> tuple[Array, NDArrayBool]:
    """Weighted squares of the errors (T, h, w), and which pixels with a weight the outline crosses."""
    share, gradient = modelled(scene, seen)
    edge = (np.abs(gradient).sum(axis=(-1, -2)) > 1e-9) & (seen.weight > 0)
    return seen.weight * (share - seen.share) ** 2, edge


def calibrated(scene: MovingPolygon, seen: Observation) -> Observation:
    """The observation with the object's colour corrected so that the scene explains it best: blur may hide a pure one."""
    share, _ = modelled(scene, seen)
    scale = float((seen.weight * share * seen.share).sum() / (seen.weight * share * share).sum())
    return replace(seen, share=seen.share / scale, weight=seen.weight * scale**2)


def without_outliers(scene: MovingPolygon, seen: Observation) -> Observation:
    """The observation without the pixels that the scene is far from explaining, as where something hides the object."""
    share, _ = modelled(scene, seen)
    error = np.abs(share - seen.share)
    far = error > FAR + 4 / np.sqrt(np.maximum(seen.weight, 1e-12))
    return replace(seen, weight=np.where(far, 0.0, seen.weight))


def quadratic(scene: MovingPolygon, seen: Observation) -> Quadratic:
    """The cost around a scene."""
    share, gradient = modelled(scene, seen)
    cost, slope, square = _normal_equations(share - seen.share, seen.weight, gradient)
    return Quadratic(cost, *_chain(slope, square, scene.vertices - scene.centre, scene.motion[:, 2]))


@numba.njit(cache=True)
def _normal_equations(error: Array, weight: Array, gradient: Array) -> tuple[float, Array, Array]:
    """Cost, gradient (T, n) and matrix (T, n, n) with respect to the placed vertices; most entries per pixel are zero."""
    steps, height, width = error.shape
    count = 2 * gradient.shape[3]
    flat = gradient.reshape(steps, height, width, count)
    cost, slope, square = 0.0, np.zeros((steps, count)), np.zeros((steps, count, count))
    touched = np.empty(count, dtype=np.int64)
    for t in range(steps):
        for j in range(height):
            for i in range(width):
                e, w = error[t, j, i], weight[t, j, i]
                cost += 0.5 * w * e * e
                n = 0
                for k in range(count):
                    if flat[t, j, i, k] != 0.0:
                        touched[n] = k
                        n += 1
                for a in range(n):
                    u = touched[a]
                    pull = w * flat[t, j, i, u]
                    slope[t, u] += pull * e
                    for b in range(n):
                        square[t, u, touched[b]] += pull * flat[t, j, i, touched[b]]
    return cost, slope, square


@numba.njit(cache=True)
def _frame(arms: Array, angle: float) -> Array:
    """Derivative of one step's placed vertices by the vertices at step 0 and by the step's motion, (2 V, 2 V + 3)."""
    count = arms.size
    out = np.zeros((count, count + 3))
    c, s = np.cos(angle), np.sin(angle)
    for i in range(0, count, 2):
        x, y = arms[i // 2]
        out[i, i], out[i, i + 1], out[i + 1, i], out[i + 1, i + 1] = c, -s, s, c
        out[i, count], out[i + 1, count + 1] = 1.0, 1.0
        out[i, count + 2], out[i + 1, count + 2] = -s * x - c * y, c * x - s * y
    return out


@numba.njit(cache=True)
def _chain(slope: Array, square: Array, arms: Array, angles: Array) -> tuple[Array, Array]:
    """From placed vertices to the parameters: vertices, then motion[1:]."""
    steps, count = slope.shape
    size = count + 3 * (steps - 1)
    gradient, matrix = np.zeros(size), np.zeros((size, size))
    for t in range(steps):
        frame = _frame(arms, angles[t])
        local = frame.T @ square[t] @ frame
        pull = frame.T @ slope[t]
        offset = 3 * (t - 1)  # parameter `count` of the frame is `count + offset` of all
        shown = count + 3 if t > 0 else count
        for a in range(shown):
            u = a if a < count else a + offset
            gradient[u] += pull[a]
            for b in range(shown):
                matrix[u, b if b < count else b + offset] += local[a, b]
    return gradient, matrix


def fit(
    scene: MovingPolygon,
    seen: Observation,
    *,
    iterations: int = 30,
    free: slice = slice(None),
    precision: float = 1e-5,
) -> tuple[MovingPolygon, Quadratic]:
    """Levenberg-Marquardt over the parameters `free` (default: all), until the cost falls by less than `precision` of itself."""
    here, damping = quadratic(scene, seen), 1e-3
    for _ in range(iterations):
        step = np.zeros(len(here.gradient))
        step[free] = _damped_step(here.matrix[free, free], here.gradient[free], damping)
        longest = np.abs(scene.moved(step).placed() - scene.placed()).max()
        trial = scene.moved(step * min(1.0, LONGEST_STEP / max(longest, 1e-12)))
        # An outline that crosses itself stands for no object: such a step counts as one uphill.
        there = quadratic(trial, seen) if is_simple(trial.vertices) else None
        if there is None or there.cost >= here.cost:
            if damping > 1e4 or longest < 1e-6:
                break
            damping *= 8
            continue
        done = here.cost - there.cost < precision * here.cost
        scene, here, damping = trial, there, max(damping / 5, 1e-8)
        if done:
            break
    return scene, here


def _damped_step(matrix: Array, gradient: Array, damping: float) -> Array:
    diagonal = np.diag(matrix)
    floor = LEAST_DAMPING * diagonal.mean() + 1e-12
    return np.asarray(-np.linalg.solve(matrix + np.diag(damping * diagonal + floor), gradient))
