"""Least squares between observed and modelled pixel coverage, over the polygon's vertices and its motion together."""

from dataclasses import dataclass, replace

import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dlm.perception.raster import coverage
from expert.geometry.pose import Array, rotation

LONGEST_STEP = 1.0
"""No vertex moves further than this in one iteration [pixels]: the outline sees only the pixels that it crosses."""


@dataclass(frozen=True)
class Observation:
    """Windows around the object: its share of each pixel (T, h, w), their weights (inverse variances), origins (T, 2)."""

    share: Array
    weight: Array
    origins: Array
    blur: float = 0.0


@dataclass(frozen=True)
class Scene:
    """vertices (V, 2) at step 0 [pixels]; motion (T, 3): turn about `centre`, then shift [pixels, pixels, rad]; motion[0] = 0."""

    vertices: Array
    motion: Array
    centre: Array

    def placed(self) -> Array:
        """Vertices at all steps, (T, V, 2) [pixels]."""
        arms = (self.vertices - self.centre) @ np.swapaxes(rotation(self.motion[:, 2]), -1, -2)
        return self.centre + self.motion[:, None, :2] + arms

    def moved(self, step: Array) -> "Scene":
        """By parameters in the order of `derivative`."""
        count = self.vertices.size
        motion = self.motion.copy()
        motion[1:] += step[count:].reshape(-1, 3)
        return replace(self, vertices=self.vertices + step[:count].reshape(-1, 2), motion=motion)

    def derivative(self) -> Array:
        """Of placed vertices with respect to all parameters: vertices, then motion[1:]; (T, V, 2, 2 V + 3 (T - 1))."""
        steps, count = len(self.motion), len(self.vertices)
        turn = rotation(self.motion[:, 2])
        out = np.zeros((steps, count, 2, 2 * count + 3 * steps))
        for i in range(count):
            out[:, i, :, 2 * i : 2 * i + 2] = turn
        arms = (self.vertices - self.centre) @ np.swapaxes(turn, -1, -2)
        for t in range(steps):
            k = 2 * count + 3 * t
            out[t, :, 0, k], out[t, :, 1, k + 1] = 1, 1
            out[t, :, 0, k + 2], out[t, :, 1, k + 2] = -arms[t, :, 1], arms[t, :, 0]
        return np.delete(out, np.s_[2 * count : 2 * count + 3], axis=-1)


@dataclass(frozen=True)
class Quadratic:
    """Half the weighted sum of squares at a scene, its gradient and Gauss-Newton matrix."""

    cost: float
    gradient: Array
    matrix: Array


def modelled(scene: Scene, seen: Observation) -> tuple[Array, Array]:
    """Coverage in the windows (T, h, w) and its gradient (T, h, w, V, 2) as the camera sees them."""
    share, gradient = coverage(scene.placed(), seen.origins, *seen.share.shape[1:])
    if seen.blur > 0:
        for axis in (1, 2):
            share = gaussian_filter1d(share, seen.blur, axis=axis)
            gradient = gaussian_filter1d(gradient, seen.blur, axis=axis)
    return share, gradient


def quadratic(scene: Scene, seen: Observation) -> Quadratic:
    """The cost around a scene."""
    share, gradient = modelled(scene, seen)
    steps, count = len(scene.motion), scene.vertices.size
    cost, slope, square = _normal_equations(
        share - seen.share, seen.weight, gradient.reshape(*share.shape, count)
    )
    chain = scene.derivative().reshape(steps, count, -1)
    back = np.swapaxes(chain, -1, -2)
    return Quadratic(cost, (back @ slope[..., None])[..., 0].sum(axis=0), (back @ square @ chain).sum(axis=0))


@numba.njit(cache=True)
def _normal_equations(error: Array, weight: Array, gradient: Array) -> tuple[float, Array, Array]:
    """Cost, gradient (T, n) and matrix (T, n, n) with respect to the placed vertices; most entries per pixel are zero."""
    steps, height, width, count = gradient.shape
    cost, slope, square = 0.0, np.zeros((steps, count)), np.zeros((steps, count, count))
    touched = np.empty(count, dtype=np.int64)
    for t in range(steps):
        for j in range(height):
            for i in range(width):
                e, w = error[t, j, i], weight[t, j, i]
                cost += 0.5 * w * e * e
                n = 0
                for k in range(count):
                    if gradient[t, j, i, k] != 0.0:
                        touched[n] = k
                        n += 1
                for a in range(n):
                    u = touched[a]
                    pull = w * gradient[t, j, i, u]
                    slope[t, u] += pull * e
                    for b in range(n):
                        v = touched[b]
                        square[t, u, v] += pull * gradient[t, j, i, v]
    return cost, slope, square


def fit(
    scene: Scene,
    seen: Observation,
    *,
    iterations: int = 30,
    free: slice = slice(None),
    precision: float = 1e-5,
) -> tuple[Scene, Quadratic]:
    """Levenberg-Marquardt over the parameters `free` (default: all), until the cost falls by less than `precision` of itself."""
    here, damping = quadratic(scene, seen), 1e-3
    for _ in range(iterations):
        step = np.zeros(len(here.gradient))
        step[free] = _damped_step(here.matrix[free, free], here.gradient[free], damping)
        longest = np.abs(scene.moved(step).placed() - scene.placed()).max()
        trial = scene.moved(step * min(1.0, LONGEST_STEP / max(longest, 1e-12)))
        there = quadratic(trial, seen)
        if there.cost >= here.cost:
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
    floor = 1e-6 * diagonal.mean() + 1e-12
    return np.asarray(-np.linalg.solve(matrix + np.diag(damping * diagonal + floor), gradient))
