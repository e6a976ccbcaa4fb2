"""Where the fit starts: an outline with more corners than needed, and the object's turn from frame to frame."""

from collections.abc import Iterable
from dataclasses import replace

import contourpy
import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from dlm.perception.fit import MovingPolygon, Observation, crossed, fit
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.world.values import IntArray

HARMONICS = 16
ANGLES = 720
NEAREST = 2
"""Turns that are tried in each frame besides the most likely one: those next to the frame before."""
SMOOTH = 0.5
"""Blur under which the first outline is drawn [pixels]."""
BAD_FRAME = 9.0
"""A frame is aligned again where its errors' mean square exceeds that of the typical frame so many times."""


def first_scene(seen: Observation, reference: int, most_vertices: int) -> MovingPolygon:
    """Outline as seen in frame `reference`, and the motion, fitted together."""
    shares = _filled(seen)
    outline = outline_of(shares[reference], most_vertices) + seen.origins[reference]
    centres = np.array([_centre(share) for share in shares])
    spectra = [_harmonics(share, centre) for share, centre in zip(shares, centres, strict=True)]
    middles = centres + seen.origins
    motion = np.zeros((len(shares), 3))
    motion[:, :2] = middles - middles[reference]
    scene = MovingPolygon(outline, motion, middles[reference])
    steps = len(shares)
    for order in (range(reference + 1, steps), range(reference - 1, -1, -1)):
        for t in order:
            nearest = motion[t - 1 if t > reference else t + 1, 2]
            turns = _likely(_turns(spectra[reference], spectra[t]), nearest)
            motion[t] = _aligned(scene, seen, t, turns, nearest)
    scene, _ = fit(scene.seen_from_first_step(), seen)
    return _realigned(scene, seen)


def clearest_frames(seen: Observation) -> IntArray:
    """Frames in order of how much of the object is hidden, the least first."""
    return np.argsort((seen.weight == 0).sum(axis=(1, 2)), kind="stable")


def _filled(seen: Observation) -> Array:
    """Shares with the pixels that tell nothing painted over from around them."""
    out = seen.share.copy()
    for t in np.flatnonzero((seen.weight == 0).any(axis=(1, 2))):
        levels = np.clip(np.rint(255 * out[t]), 0, 255).astype(np.uint8)
        hidden = (seen.weight[t] == 0).astype(np.uint8)
        painted = cv2.inpaint(levels, hidden, 3, cv2.INPAINT_TELEA) / 255
        out[t] = np.where(hidden, painted, out[t])
    return out


def outline_of(share: Array, most_vertices: int) -> Array:
    """Counter-clockwise polygon (V, 2) along the level of one half, in pixels from the window's corner."""
    height, width = share.shape
    level = contourpy.contour_generator(
        x=np.arange(width) + 0.5, y=np.arange(height) + 0.5, z=gaussian_filter(share, SMOOTH)
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
    mass = _mass(share)
    y, x = np.indices(share.shape) + 0.5
    return np.array([(mass * x).sum(), (mass * y).sum()]) / mass.sum()


def _mass(share: Array) -> Array:
    return np.where(share > 0.25, np.clip(share, 0, 1), 0)


def _harmonics(share: Array, centre: Array) -> Array:
    """Circular harmonics of the second moment of area; a turn by theta multiplies the k-th by exp(-i k theta)."""
    y, x = np.indices(share.shape) + 0.5
    z = (x - centre[0]) + 1j * (y - centre[1])
    radius = np.abs(z)
    unit = np.conj(z) / np.maximum(radius, 1e-9)
    powers = unit[..., None] ** np.arange(1, HARMONICS + 1)
    return np.asarray(np.tensordot(_mass(share) * radius**2, powers, axes=2))


def _turns(before: Array, after: Array) -> Array:
    """Angles at which the correlation of two spectra peaks, the highest first."""
    spectrum = np.zeros(ANGLES, dtype=complex)
    spectrum[1 : HARMONICS + 1] = after * np.conj(before)
    match = np.fft.ifft(spectrum).real
    peaks = np.flatnonzero((match >= np.roll(match, 1)) & (match > np.roll(match, -1)))
    best = peaks[np.argsort(match[peaks])[::-1]]
    return 2 * np.pi / ANGLES * best[match[best] > 0.6 * match.max()]


def _likely(turns: Array, nearest: float) -> Array:
    """The best of the turns, which comes first, and those next to the angle `nearest`."""
    distance = np.abs(np.mod(turns - nearest + np.pi, 2 * np.pi) - np.pi)
    return turns[np.unique([0, *np.argsort(distance)[:NEAREST]])]


def _aligned(
    scene: MovingPolygon, seen: Observation, t: int, turns: Iterable[float], nearest: float
) -> Array:
    """Pose (3,) of frame t; of equally good turns the one next to the angle `nearest`."""
    one = Observation(seen.share[[t, t]], seen.weight[[t, t]], seen.origins[[t, t]], seen.blur)
    near = nearest + np.mod(np.asarray(turns) - nearest + np.pi, 2 * np.pi) - np.pi
    trials = []
    for angle in near[np.argsort(np.abs(near - nearest))]:
        # Step 0 stands still: its residual is the same in all trials.
        guess = replace(scene, motion=np.array([scene.motion[t], [*scene.motion[t, :2], angle]]))
        pose = slice(scene.vertices.size, None)
        found, value = fit(guess, one, iterations=12, free=pose, precision=1e-3)
        trials.append((value.cost, found.motion[1]))
    least = min(cost for cost, _ in trials)
    return next(motion for cost, motion in trials if cost <= 1.02 * least + 10)


def _realigned(scene: MovingPolygon, seen: Observation) -> MovingPolygon:
    """Frames that fit much worse than the others are aligned again, from all directions."""
    everywhere = np.arange(16) * (np.pi / 8)
    for _ in range(2):
        worth = frame_errors(scene, seen)
        bad = np.flatnonzero(worth > BAD_FRAME * max(1.0, float(np.median(worth))))
        if not len(bad):
            break
        motion = scene.motion.copy()
        for t in bad[bad > 0]:
            motion[t] = _aligned(scene, seen, int(t), everywhere, motion[t - 1, 2])
        scene, _ = fit(replace(scene, motion=motion), seen)
    return scene


def frame_errors(scene: MovingPolygon, seen: Observation) -> Array:
    """Mean weighted square of the errors of the pixels that the outline crosses, per frame (T,); 1 is noise alone."""
    squares, edge = crossed(scene, seen)
    return np.array([s[e].mean() if e.any() else 0.0 for s, e in zip(squares, edge, strict=True)])
