"""Which features touch: fingers against the polygon, polygon vertices against walls, and how contacts move.

A contact has a unit direction `normal` along which its force pushes the object, a `point` where the force acts and a
signed `gap`.  Row 2 i of the contact Jacobian is the normal direction of contact i, row 2 i + 1 the tangent, the normal
turned by +90 degrees.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.scene import SceneArrays
from dlm.simulator.settings import Physics

FACET, VERTEX, WALL = 0, 1, 2
WALL_POINTS = 4
"""At most this many vertices touch one wall."""
REACH = 2e-3
"""Rigid contacts that a step would leave at least this far apart are not handed to the LCP [m]."""
LEAST_ACTIVATION = 1e-6


class View(NamedTuple):
    """One scene without its padding."""

    vertices: np.ndarray
    outward: np.ndarray
    length: np.ndarray
    reflex: np.ndarray
    mass: float
    inertia: float
    friction: float
    stiffness: float
    gravity: float
    support: float
    walls: np.ndarray
    dt: float


class Contacts(NamedTuple):
    """Work space for at most n contacts; `finger` is -1 for walls, `feature` a facet, a vertex or a wall's vertex."""

    kind: np.ndarray
    finger: np.ndarray
    feature: np.ndarray
    sign: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    gap: np.ndarray
    friction: np.ndarray
    wall: np.ndarray


@njit(cache=True)
def view(scenes: SceneArrays, b: int) -> View:
    """Scene b of a batch."""
    n = scenes.vertex_count[b]
    return View(
        scenes.vertices[b, :n],
        scenes.outward[b, :n],
        scenes.length[b, :n],
        scenes.reflex[b, :n],
        scenes.mass[b],
        scenes.inertia[b],
        scenes.friction[b],
        scenes.stiffness[b],
        scenes.gravity[b],
        scenes.support[b],
        scenes.walls[b, : scenes.wall_count[b]],
        scenes.dt[b],
    )


@njit(cache=True)
def contacts_for(size: int) -> Contacts:
    """Empty work space."""
    return Contacts(
        np.zeros(size, np.int64),
        np.zeros(size, np.int64),
        np.zeros(size, np.int64),
        np.zeros(size),
        np.zeros((size, 2)),
        np.zeros((size, 2)),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size, np.int64),
    )


@njit(cache=True)
def activation(gap: float, kappa: float) -> float:
    """min(1, 2 sigmoid(-kappa gap)), the smoothed contact indicator (Thesis 4-CT9); 0 or 1 for kappa = inf."""
    if gap <= 0:
        return 1.0
    return 2 / (1 + np.exp(min(kappa * gap, 500.0)))


@njit(cache=True)
def nearest(scene: View, x: float, y: float) -> tuple[int, int, float, float]:
    """Feature of the boundary nearest to a body point: kind, index, signed distance, coordinate along the facet."""
    n = len(scene.vertices)
    best, kind, index, side, where = np.inf, FACET, 0, 1.0, 0.0
    for k in range(n):
        dx, dy = x - scene.vertices[k, 0], y - scene.vertices[k, 1]
        nx, ny = scene.outward[k, 0], scene.outward[k, 1]
        height, along = dx * nx + dy * ny, dy * nx - dx * ny
        beyond = along - scene.length[k]
        if along < 0 or beyond > 0:
            off = along if along < 0 else beyond
            square = height * height + off * off
            if square < best and square > 1e-24:
                best, kind, side = square, VERTEX, 1.0
                index = k if along < 0 else (k + 1) % n
                if scene.reflex[index]:
                    side = -1.0
                continue
        square = height * height
        if square <= best and along >= 0 and beyond <= 0:
            best, kind, index, where = square, FACET, k, along
            side = 1.0 if height >= 0 else -1.0
    return kind, index, side * np.sqrt(best), where


@njit(cache=True)
def collect(
    scene: View,
    physics: Physics,
    pose: np.ndarray,
    velocity: np.ndarray,
    fingers: np.ndarray,
    finger_velocity: np.ndarray,
    out: Contacts,
) -> int:
    """Fill `out` with the contacts that may act during the next step; return their number."""
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    h = scene.dt / physics.substeps
    n = 0
    for c in range(len(fingers)):
        n = _finger_contacts(scene, physics, pose, cs, sn, velocity, fingers, finger_velocity, c, h, out, n)
    for w in range(len(scene.walls)):
        n = _wall_contacts(scene, physics, pose, cs, sn, velocity, w, h, out, n)
    return n


@njit(cache=True)
def _acts(gap: float, closing: float, h: float, kappa: float) -> bool:
    if np.isinf(kappa):
        return gap + h * closing < REACH
    return activation(gap, kappa) > LEAST_ACTIVATION


@njit(cache=True)
def _finger_contacts(
    scene: View,
    physics: Physics,
    pose: np.ndarray,
    cs: float,
    sn: float,
    velocity: np.ndarray,
    fingers: np.ndarray,
    finger_velocity: np.ndarray,
    c: int,
    h: float,
    out: Contacts,
    n: int,
) -> int:
    """The nearest feature, and beside a reflex vertex the neighbouring facet too."""
    dx, dy = fingers[c, 0] - pose[0], fingers[c, 1] - pose[1]
    bx, by = cs * dx + sn * dy, cs * dy - sn * dx
    kind, index, _, _ = nearest(scene, bx, by)
    first = n
    n = _add_finger(
        scene, physics, pose, cs, sn, velocity, fingers, finger_velocity, c, h, kind, index, out, n
    )
    if kind == FACET:
        count = len(scene.vertices)
        for step in (0, 1):
            corner = (index + step) % count
            if scene.reflex[corner]:
                other = (index - 1) % count if step == 0 else corner
                ex, ey = bx - scene.vertices[other, 0], by - scene.vertices[other, 1]
                along = ey * scene.outward[other, 0] - ex * scene.outward[other, 1]
                if 0 <= along <= scene.length[other] and n <= first + 1:
                    n = _add_finger(
                        scene,
                        physics,
                        pose,
                        cs,
                        sn,
                        velocity,
                        fingers,
                        finger_velocity,
                        c,
                        h,
                        FACET,
                        other,
                        out,
                        n,
                    )
    return n


@njit(cache=True)
def _add_finger(
    scene: View,
    physics: Physics,
    pose: np.ndarray,
    cs: float,
    sn: float,
    velocity: np.ndarray,
    fingers: np.ndarray,
    finger_velocity: np.ndarray,
    c: int,
    h: float,
    kind: int,
    index: int,
    out: Contacts,
    n: int,
) -> int:
    """Contact of finger c with one feature, unless it is out of reach."""
    vx, vy = scene.vertices[index, 0], scene.vertices[index, 1]
    px, py = fingers[c, 0], fingers[c, 1]
    ax, ay = pose[0] + cs * vx - sn * vy, pose[1] + sn * vx + cs * vy
    if kind == FACET:
        ox, oy = scene.outward[index, 0], scene.outward[index, 1]
        nx, ny, sign = cs * ox - sn * oy, sn * ox + cs * oy, 1.0
        distance = (px - ax) * nx + (py - ay) * ny
        qx, qy = px - distance * nx, py - distance * ny
    else:
        sign = -1.0 if scene.reflex[index] else 1.0
        reach = np.hypot(px - ax, py - ay)
        nx, ny = sign * (px - ax) / reach, sign * (py - ay) / reach
        distance, qx, qy = sign * reach, ax, ay
    gap = distance - physics.radius
    ux = velocity[0] - velocity[2] * (qy - pose[1]) - finger_velocity[c, 0]
    uy = velocity[1] + velocity[2] * (qx - pose[0]) - finger_velocity[c, 1]
    if not _acts(gap, -(nx * ux + ny * uy), h, physics.kappa):
        return n
    out.kind[n], out.finger[n], out.feature[n], out.sign[n], out.wall[n] = kind, c, index, sign, -1
    # The finger pushes the object inwards, against the outward normal.
    out.normal[n, 0], out.normal[n, 1] = -nx, -ny
    out.point[n, 0], out.point[n, 1] = qx, qy
    out.gap[n], out.friction[n] = gap, scene.friction
    return n + 1


@njit(cache=True)
def _wall_contacts(
    scene: View,
    physics: Physics,
    pose: np.ndarray,
    cs: float,
    sn: float,
    velocity: np.ndarray,
    w: int,
    h: float,
    out: Contacts,
    n: int,
) -> int:
    """The lowest vertices over wall w."""
    wall = scene.walls[w]
    nx, ny = wall[2], wall[3]
    base = n
    for k in range(len(scene.vertices)):
        vx, vy = scene.vertices[k, 0], scene.vertices[k, 1]
        rx, ry = cs * vx - sn * vy, sn * vx + cs * vy
        gap = (pose[0] + rx - wall[0]) * nx + (pose[1] + ry - wall[1]) * ny
        closing = nx * (velocity[0] - velocity[2] * ry) + ny * (velocity[1] + velocity[2] * rx)
        if not _acts(gap, closing, h, physics.kappa):
            continue
        at = n
        if n - base == WALL_POINTS:
            at = base + int(np.argmax(out.gap[base:n]))
            if out.gap[at] <= gap:
                continue
        else:
            n += 1
        out.kind[at], out.finger[at], out.feature[at], out.sign[at], out.wall[at] = WALL, -1, k, 1.0, w
        out.normal[at, 0], out.normal[at, 1] = nx, ny
        out.point[at, 0], out.point[at, 1] = pose[0] + rx, pose[1] + ry
        out.gap[at], out.friction[at] = gap, wall[4]
    return n
