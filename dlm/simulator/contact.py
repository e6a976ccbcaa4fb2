"""Which features touch: fingers against the polygon, and polygon vertices against walls.

A contact has a unit direction n along which its force pushes the object, a point where the force acts and a signed gap.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator.kernels import borrowing, compiled, inlined
from dlm.simulator.world import World, vertex_arm

FACET, VERTEX, WALL = 0, 1, 2
CONTACT = np.dtype(
    [(name, "i8") for name in ("kind", "finger", "feature", "wall", "state")]
    + [(name, "f8") for name in ("nx", "ny", "x", "y", "gap", "friction")]
)
"""kind; finger or -1; feature: facet, vertex or a wall's vertex; wall or -1; state: see `lcp`; n; point; gap; friction."""
COLLINEAR, SAME_PLACE = 1e-9, 1e-12
"""Slopes that differ by less are one line; vertices as close along a wall are one place [m]."""
REACH = 2e-3
"""Rigid contacts that a step would leave at least this far apart are not handed to the LCP [m]."""
LEAST_ACTIVATION = 1e-6


class Moment(NamedTuple):
    """The start of a step: pose (3,), its cosine and sine, fingers (C, 2), and the velocities without any contact."""

    pose: np.ndarray
    cs: float
    sn: float
    velocity: np.ndarray
    fingers: np.ndarray
    finger_velocity: np.ndarray


@borrowing
def activation(gap: float, kappa: float) -> float:
    """min(1, 2 sigmoid(-kappa gap)), the smoothed contact indicator (Thesis 4-CT9); 0 or 1 for kappa = inf."""
    if gap <= 0:
        return 1.0
    return 2 / (1 + np.exp(min(kappa * gap, 500.0)))


@borrowing
def nearest(facets: np.ndarray, x: float, y: float) -> tuple[int, int, float]:
    """Feature of the boundary nearest to a body point: kind, index, signed distance (negative inside)."""
    n = len(facets)
    best, kind, index, side = np.inf, FACET, 0, 1.0
    for k in range(n):
        dx, dy = x - facets[k].x, y - facets[k].y
        height = dx * facets[k].ox + dy * facets[k].oy
        along = dy * facets[k].ox - dx * facets[k].oy
        beyond = along - facets[k].length
        square = height * height
        if along >= 0 and beyond <= 0:
            if square <= best:
                best, kind, index = square, FACET, k
                side = 1.0 if height >= 0 else -1.0
            continue
        off = along if along < 0 else beyond
        square += off * off
        if 1e-24 < square < best:
            best, kind = square, VERTEX
            index = k if along < 0 else (k + 1) % n
            # Nearest to a convex vertex only points outside are, nearest to a reflex one only points inside.
            side = 1.0 - 2.0 * facets[index].reflex
    return kind, index, side * np.sqrt(best)


@borrowing
def collect(world: World, now: Moment, out: np.ndarray) -> int:
    """Fill `out`, an array of CONTACT, with those that may act during the next step; return their number."""
    n = np.int64(0)  # a literal has a type of its own, and all below would be compiled twice
    for c in range(len(now.fingers)):
        dx, dy = now.fingers[c, 0] - now.pose[0], now.fingers[c, 1] - now.pose[1]
        bx, by = now.cs * dx + now.sn * dy, now.cs * dy - now.sn * dx
        kind, index, _ = nearest(world.facets, bx, by)
        n = _add_finger(world, now, c, (np.int64(kind), index), out, n)
        if kind == FACET:
            other = _second_facet(world.facets, index, bx, by)
            if other >= 0:
                n = _add_finger(world, now, c, (np.int64(FACET), other), out, n)
    for w in range(len(world.walls)):
        n = _add_wall(world, now, w, out, n)
    return int(n)


@borrowing
def _second_facet(facets: np.ndarray, index: int, x: float, y: float) -> int:
    """Facet beyond a reflex end of facet `index` that a point faces too; -1 if there is none."""
    count = len(facets)
    for step in (0, 1):
        corner = (index + step) % count
        if facets[corner].reflex > 0:
            other = (index - 1) % count if step == 0 else corner
            dx, dy = x - facets[other].x, y - facets[other].y
            along = dy * facets[other].ox - dx * facets[other].oy
            if 0 <= along <= facets[other].length:
                return other
    return -1


@borrowing
def _acts(gap: float, approach: float, kappa: float) -> bool:
    """Whether a contact can matter that closes by `approach` during the step."""
    if np.isinf(kappa):
        return gap - approach < REACH
    return activation(gap, kappa) > LEAST_ACTIVATION


@inlined
def _add_finger(world: World, now: Moment, c: int, feature: tuple[int, int], out: np.ndarray, n: int) -> int:
    """Contact of finger c with a feature (kind, index), unless it is out of reach."""
    kind, index = feature
    facet = world.facets[index]
    px, py = now.fingers[c, 0], now.fingers[c, 1]
    ax = now.pose[0] + now.cs * facet.x - now.sn * facet.y
    ay = now.pose[1] + now.sn * facet.x + now.cs * facet.y
    if kind == FACET:
        nx, ny = vertex_arm(facet.ox, facet.oy, now.cs, now.sn)
        distance = (px - ax) * nx + (py - ay) * ny
        qx, qy = px - distance * nx, py - distance * ny
    else:
        sign = 1 - 2 * facet.reflex
        reach = np.sqrt((px - ax) ** 2 + (py - ay) ** 2)
        nx, ny = sign * (px - ax) / reach, sign * (py - ay) / reach
        distance, qx, qy = sign * reach, ax, ay
    gap = distance - world.radius
    ux = now.velocity[0] - now.velocity[2] * (qy - now.pose[1]) - now.finger_velocity[c, 0]
    uy = now.velocity[1] + now.velocity[2] * (qx - now.pose[0]) - now.finger_velocity[c, 1]
    if not _acts(gap, world.h * (nx * ux + ny * uy), world.kappa):
        return n
    contact = out[n]
    contact.kind, contact.finger, contact.feature, contact.wall = kind, c, index, -1
    # The finger pushes the object inwards, against the outward normal.
    contact.nx, contact.ny, contact.x, contact.y = -nx, -ny, qx, qy
    contact.gap, contact.friction = gap, world.friction
    return n + 1


@inlined
def _add_wall(world: World, now: Moment, w: int, out: np.ndarray, n: int) -> int:
    """The vertices that may touch wall w first, however the object moves: the lower convex hull of those near it."""
    wall, base = world.walls[w], n
    nx, ny = wall.nx, wall.ny
    for k in range(len(world.facets)):
        rx, ry = vertex_arm(world.facets[k].x, world.facets[k].y, now.cs, now.sn)
        gap = (now.pose[0] + rx - wall.x) * nx + (now.pose[1] + ry - wall.y) * ny
        opening = nx * (now.velocity[0] - now.velocity[2] * ry) + ny * (
            now.velocity[1] + now.velocity[2] * rx
        )
        if not _acts(gap, -world.h * opening, world.kappa):
            continue
        contact = out[n]
        contact.kind, contact.finger, contact.feature, contact.wall = WALL, -1, k, w
        contact.nx, contact.ny, contact.x, contact.y = nx, ny, now.pose[0] + rx, now.pose[1] + ry
        contact.gap, contact.friction = gap, wall.friction
        n += 1
    return n if n - base <= 2 else _lower_hull(out, base, n)


@compiled
def _lower_hull(out: np.ndarray, base: int, n: int) -> int:
    """Keep, of the contacts base to n with one wall, those that are not above a line between two others; the new number.

    The others cannot touch before these do: gaps change linearly along the wall in a small motion.  Collinear vertices
    between two others go too.
    """
    for i in range(base, n):
        redundant = False
        left, right = -np.inf, np.inf  # steepest slopes from one side and to the other
        for j in range(base, n):
            along = (out[j].x - out[i].x) * out[i].ny - (out[j].y - out[i].y) * out[i].nx
            rise = out[j].gap - out[i].gap
            if abs(along) < SAME_PLACE:
                redundant |= rise < 0 or (rise == 0 and j < i)
            elif along < 0:
                left = max(left, rise / along)
            else:
                right = min(right, rise / along)
        out[i].state = redundant or left >= right - COLLINEAR  # nobody has a state yet
    kept = base
    for i in range(base, n):
        if not out[i].state:
            out[kept] = out[i]
            kept += 1
    return kept
