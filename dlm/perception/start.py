"""Where the fit starts: an outline with more corners than needed, and the object's turn from frame to frame."""

import contourpy
import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from dlm.perception.fit import Observation, Scene, fit
from expert.errors import InvalidProblem
from expert.geometry.pose import Array

HARMONICS = 16
ANGLES = 720
RIVALS = 3
"""Turns that are tried in each frame."""


def first_scene(seen: Observation, most_vertices: int) -> Scene:
    """Outline of frame 0 and a rough motion."""
    outline = outline_of(seen.share[0], most_vertices, smooth=0.5) + seen.origins[0]
    centres = np.array([_centre(share) for share in seen.share]) + seen.origins
    motion = np.zeros((len(centres), 3))
    motion[:, :2] = centres - centres[0]
    scene = Scene(outline, motion, centres[0])
    spectra = [_harmonics(share, c) for share, c in zip(seen.share, centres - seen.origins, strict=True)]
    for t in range(1, len(centres)):
        scene = _turned(scene, seen, t, _turns(spectra[0], spectra[t]))
    return scene


def outline_of(share: Array, most_vertices: int, smooth: float) -> Array:
    """Counter-clockwise polygon (V, 2) along the level of one half, in pixels from the window's corner."""
    height, width = share.shape
    level = contourpy.contour_generator(
        x=np.arange(width) + 0.5, y=np.arange(height) + 0.5, z=gaussian_filter(share, smooth)
    )
    lines = [np.asarray(line) for line in level.lines(0.5)]
    if not lines:
        raise InvalidProblem(
            "video",
            expected="an object of several pixels",
            got="a smaller one",
            remedy="move the camera nearer",
        )
    line = max(lines, key=lambda points: abs(_area(points)))[:-1]
    line = line if _area(line) > 0 else line[::-1]
    slack = 0.2
    while True:
        corners = cv2.approxPolyDP(line.astype(np.float32), slack, closed=True)[:, 0].astype(float)
        if len(corners) <= most_vertices:
            return corners
        slack *= 1.15


def _area(points: Array) -> float:
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _centre(share: Array) -> Array:
    mass = np.where(share > 0.25, np.clip(share, 0, 1), 0)
    y, x = np.indices(share.shape) + 0.5
    return np.array([(mass * x).sum(), (mass * y).sum()]) / mass.sum()


def _harmonics(share: Array, centre: Array) -> Array:
    """Circular harmonics of the second moment of area; a turn by theta multiplies the k-th by exp(-i k theta)."""
    y, x = np.indices(share.shape) + 0.5
    z = (x - centre[0]) + 1j * (y - centre[1])
    radius = np.abs(z)
    mass = np.where(share > 0.25, np.clip(share, 0, 1), 0) * radius**2
    unit = np.conj(z) / np.maximum(radius, 1e-9)
    return np.array([(mass * unit**k).sum() for k in range(1, HARMONICS + 1)])


def _turns(before: Array, after: Array) -> Array:
    """Angles at which the correlation of two spectra peaks, the highest first."""
    spectrum = np.zeros(ANGLES, dtype=complex)
    spectrum[1 : HARMONICS + 1] = after * np.conj(before)
    match = np.fft.ifft(spectrum).real
    peak = (match >= np.roll(match, 1)) & (match > np.roll(match, -1))
    peaks = np.flatnonzero(peak)
    best = peaks[np.argsort(match[peaks])[::-1]]
    return 2 * np.pi / ANGLES * best[match[best] > 0.6 * match.max()][:RIVALS]


def _turned(scene: Scene, seen: Observation, t: int, turns: Array) -> Scene:
    """The scene with frame t aligned: of equally good turns the one nearest to the frame before."""
    last = scene.motion[t - 1, 2]
    near = last + np.mod(turns - last + np.pi, 2 * np.pi) - np.pi
    pair = Observation(seen.share[[0, t]], seen.weight[[0, t]], seen.origins[[0, t]], seen.blur)
    pose = slice(scene.vertices.size, None)
    trials = []
    for angle in near[np.argsort(np.abs(near - last))]:
        motion = np.array([scene.motion[0], [*scene.motion[t, :2], angle]])
        aligned, value = fit(
            Scene(scene.vertices, motion, scene.centre), pair, iterations=12, free=pose, precision=1e-3
        )
        trials.append((value.cost, aligned.motion[1]))
    least = min(cost for cost, _ in trials)
    chosen = next(motion for cost, motion in trials if cost <= 1.02 * least + 10)
    motions = scene.motion.copy()
    motions[t] = chosen
    return Scene(scene.vertices, motions, scene.centre)
