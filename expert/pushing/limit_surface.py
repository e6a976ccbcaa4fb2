"""Which way an object moves on a table under a finger: limit surfaces, and contacts that stick or slide (motion cone).

Quasi-static: the finger's force balances the friction of the support.  An ellipsoid with half-axes f, f, c f gives the
twist A w of a wrench w, A = diag(1, 1, 1/c^2).  Pressure points give the twist of least dissipation.  Twists and wrenches are
about the pressure's centre; c is a length.
"""

from typing import NamedTuple

import numpy as np
import shapely
from numba import njit

from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array
from expert.world.shape import Shape
from expert.world.values import require

FREE, STICKING, SLIDING = 0, 1, 2
ROUNDS = 60
CLOSE = 1e-10
"""Sine of the angle between a force and the one that is asked for."""
ROUNDING = 1e-6
"""Speeds below this fraction of the contact's are smoothed, so that a pressure point at the centre of rotation has a slope."""


class Surface(NamedTuple):
    """Limit surface: pressure points (K, 2) with shares (K,) that sum to 1; or, without points, an ellipsoid with c^2.

    Of points, c^2 is where the search for their spin begins.
    """

    points: Array
    shares: Array
    squared: float


class Motion(NamedTuple):
    """Twist of the object, and how the contact moves: FREE, STICKING or SLIDING."""

    vx: float
    vy: float
    spin: float
    mode: int


def ellipsoid(c: float) -> Surface:
    """Ellipsoid: the greatest friction torque is c times the greatest friction force."""
    require(0 < c < np.inf, "limit_surface.c", "a positive length", c)
    return Surface(np.zeros((0, 2)), np.zeros(0), float(c) ** 2)


def uniform(shape: Shape, per_side: int = 12) -> Surface:
    """Uniform pressure on the polygon: midpoints of a grid's cells, weighted by what of them is inside; centroid at 0."""
    polygon = shapely.Polygon(shape.vertices)
    low_x, low_y, high_x, high_y = polygon.bounds
    side = max(high_x - low_x, high_y - low_y) / per_side
    x, y = np.meshgrid(np.arange(low_x, high_x, side), np.arange(low_y, high_y, side))
    cells = shapely.box(x.ravel(), y.ravel(), x.ravel() + side, y.ravel() + side)
    parts = shapely.intersection(cells, polygon)
    areas = shapely.area(parts)
    kept = areas > 1e-6 * side**2
    points = shapely.get_coordinates(shapely.centroid(parts[kept]))
    arms, shares = points - mass_properties(shape.vertices).centroid, areas[kept] / areas[kept].sum()
    return Surface(arms, shares, float(shares @ np.linalg.norm(arms, axis=1)) ** 2)


def characteristic(surface: Surface) -> float:
    """c: the greatest friction torque over the greatest friction force [length]."""
    return float(np.sqrt(surface.squared))


@njit(cache=True, error_model="numpy")
def motion(
    surface: Surface, x: float, y: float, nx: float, ny: float, ux: float, uy: float, friction: float
) -> Motion:
    """Of an object touched at (x, y), inward normal n, by a finger with velocity u and a coefficient of friction."""
    if nx * ux + ny * uy <= 0:
        return Motion(0.0, 0.0, 0.0, FREE)
    guess = _elliptic_spin(surface, x, y, ux, uy)
    force_x, force_y, vx, vy, spin = _sticking(surface, x, y, ux, uy, guess)
    normal, tangential = nx * force_x + ny * force_y, -ny * force_x + nx * force_y
    if abs(tangential) <= friction * normal:
        return Motion(vx, vy, spin, STICKING)
    side = friction if tangential > 0 else -friction
    vx, vy, spin = _under_force(surface, x, y, nx - side * ny, ny + side * nx, spin / np.hypot(ux, uy))
    scale = (nx * ux + ny * uy) / (nx * (vx - spin * y) + ny * (vy + spin * x))
    return Motion(scale * vx, scale * vy, scale * spin, SLIDING)


@njit(cache=True, error_model="numpy")
def _elliptic_spin(s: Surface, x: float, y: float, ux: float, uy: float) -> float:
    """Spin on an ellipsoid where the touched point moves with the finger."""
    return (x * uy - y * ux) / (s.squared + x * x + y * y)


@njit(cache=True, error_model="numpy")
def _sticking(
    s: Surface, x: float, y: float, ux: float, uy: float, guess: float
) -> tuple[float, float, float, float, float]:
    """Force (up to a factor) and twist where the touched point moves with the finger."""
    if len(s.shares) == 0:
        spin = _elliptic_spin(s, x, y, ux, uy)
        vx, vy = ux + spin * y, uy - spin * x
        return vx, vy, vx, vy, spin
    # Least dissipation over the spin: the slope rises; Newton's method, kept between spins with slopes of both signs.
    spin, low, high = guess, -np.inf, np.inf
    fine = 1e-11 * np.hypot(ux, uy) / np.sqrt(s.squared)
    for _ in range(ROUNDS):
        fx, fy, slope, curvature = _dissipation(s, x, y, ux, uy, spin)
        if slope > 0:
            high = spin
        else:
            low = spin
        trial = spin - slope / curvature
        if abs(trial - spin) < fine or high - low < fine:
            break
        spin = trial if low < trial < high else 0.5 * (low + high)
    return fx, fy, ux + spin * y, uy - spin * x, spin


@njit(cache=True, error_model="numpy")
def _dissipation(
    s: Surface, x: float, y: float, ux: float, uy: float, spin: float
) -> tuple[float, float, float, float]:
    """Friction's force (2), and the power's first and second slope by the spin about the contact, which moves with u."""
    small = ROUNDING * np.hypot(ux, uy)
    fx = fy = gradient = curvature = 0.0
    for k in range(len(s.shares)):
        rx, ry = s.points[k, 0] - x, s.points[k, 1] - y
        vx, vy = ux - spin * ry, uy + spin * rx
        speed = np.sqrt(vx * vx + vy * vy + small * small)
        share = s.shares[k]
        along = (-ry * vx + rx * vy) / speed
        fx += share * vx / speed
        fy += share * vy / speed
        gradient += share * along
        curvature += share * (rx * rx + ry * ry - along * along) / speed
    return fx, fy, gradient, curvature + 1e-300


@njit(cache=True, error_model="numpy")
def _under_force(
    s: Surface, x: float, y: float, ex: float, ey: float, guess: float
) -> tuple[float, float, float]:
    """Twist (up to a factor) of the object under a force along e at (x, y)."""
    if len(s.shares) == 0:
        return ex, ey, (x * ey - y * ex) / s.squared
    # The contact's velocity has direction phi; of all directions with e . v = 1, sticking there costs least dissipation where
    # its own force is along e: the force's angle to e changes sign, and grows with phi.
    angle = np.arctan2(ey, ex)
    low, high, below, above, side = angle - 0.5 * np.pi, angle + 0.5 * np.pi, -1.0, 1.0, 0
    vx = vy = 0.0
    for _ in range(ROUNDS):  # false position; twice on one side, the other end's value counts half (Illinois)
        middle = (low * above - high * below) / (above - below)
        fx, fy, vx, vy, guess = _sticking(s, x, y, np.cos(middle), np.sin(middle), guess)
        off = (ex * fy - ey * fx) / np.hypot(fx, fy)
        if abs(off) < CLOSE:
            break
        if off > 0:
            high, above, below = middle, off, 0.5 * below if side > 0 else below
            side = 1
        else:
            low, below, above = middle, off, 0.5 * above if side < 0 else above
            side = -1
    return vx, vy, guess
