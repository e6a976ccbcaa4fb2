"""The object's desired motion between the knots of a plan."""

import numpy as np

from dlm.simulator.kernels import borrowing, compiled


@compiled
def desired_motion(path: np.ndarray, size: float, settings: np.record) -> np.ndarray:
    """Poses (S + 1, 3) along a path (T, 3): constant-twist screws, run through without stops but for corners.

    size: radius of gyration, the arm that turns angles into lengths [m].
    """
    T = len(path)
    out = np.zeros(((T - 1) * settings.substeps + 1, 3))
    lengths = np.zeros(T - 1)
    for k in range(T - 1):
        d = path[k + 1] - path[k]
        lengths[k] = np.sqrt(d[0] ** 2 + d[1] ** 2 + (size * d[2]) ** 2)
    slope = _knot_speeds(path, lengths, size)
    out[0, 0], out[0, 1], out[0, 2] = path[0, 0], path[0, 1], path[0, 2]
    for k in range(T - 1):
        for i in range(1, settings.substeps + 1):
            u = i / settings.substeps
            s = u
            if settings.eased and lengths[k] > 0:
                a, b = slope[k] / lengths[k], slope[k + 1] / lengths[k]
                s = u * (a + u * (3 - 2 * a - b + u * (a + b - 2)))
            screw(path[k], path[k + 1], s, out[k * settings.substeps + i])
    return out


@compiled
def _knot_speeds(path: np.ndarray, lengths: np.ndarray, size: float) -> np.ndarray:
    """Path length per interval at the knots: harmonic means (monotone cubics), slowed down in corners, 0 at the ends."""
    T = len(path)
    speed = np.zeros(T)
    for k in range(1, T - 1):
        a, b = lengths[k - 1], lengths[k]
        if a > 0 and b > 0:
            before, after = path[k] - path[k - 1], path[k + 1] - path[k]
            inner = before[0] * after[0] + before[1] * after[1] + size * size * before[2] * after[2]
            speed[k] = max(inner / (a * b), 0.0) * 2 * a * b / (a + b)
    return speed


@borrowing
def screw(start: np.ndarray, stop: np.ndarray, s: float, out: np.ndarray) -> None:
    """Pose at share s of the constant-twist motion between two poses."""
    turn = stop[2] - start[2]
    dx, dy = stop[0] - start[0], stop[1] - start[1]
    whole = np.sin(turn / 2)
    if abs(whole) < 1e-9:
        scale, half = s, 0.0
    else:
        scale, half = np.sin(s * turn / 2) / whole, (s - 1) * turn / 2
    cs, sn = np.cos(half), np.sin(half)
    out[0] = start[0] + scale * (cs * dx - sn * dy)
    out[1] = start[1] + scale * (sn * dx + cs * dy)
    out[2] = start[2] + s * turn
