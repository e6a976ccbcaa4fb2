"""From a plan at the knots to finger commands at every substep: fills the table of `commands`."""

from typing import NamedTuple

import numpy as np

from dlm.simulator.commands import Commands, commands_for
from dlm.simulator.contact import VERTEX, nearest
from dlm.simulator.kernels import borrowing, compiled, inlined
from dlm.simulator.path import desired_motion
from dlm.simulator.world import World


class Place(NamedTuple):
    """Between knots a and b, at share `share` of b, bumps along their normals [m]."""

    a: int
    b: int
    share: float
    bump_a: float
    bump_b: float


@compiled
def plan_commands(
    world: World, path: np.ndarray, positions: np.ndarray, loaded: np.ndarray, settings: np.record
) -> Commands:
    """Table for a path (T, 3), finger positions (T, C, 2) and flags loaded (T, C): the finger pushes from this knot on."""
    T, C = loaded.shape
    motion = desired_motion(path, np.sqrt(world.inertia / world.mass), settings)
    table = commands_for(len(motion), T, C)
    if settings.material_point:
        for i, d in np.ndindex((len(motion), 3)):
            table.frame[i, d] = motion[i, d]
        for t, d in np.ndindex((T, 3)):
            table.knot_frame[t, d] = path[t, d]
    for c in range(C):
        for t in range(T):
            table.lift[t, c], table.slope[t, c], table.bend[t, c] = _stand_off(
                world, path[t], positions[t, c], loaded[t, c], settings, table.normal[t, c]
            )
        for i in range(len(motion)):
            k = min(i // settings.substeps, T - 2)
            u = (i - k * settings.substeps) / settings.substeps
            if settings.compensation:
                knots, shares = _push(loaded, c, k, u, settings)
                table.force_knot[i, c, 0], table.force_knot[i, c, 1] = knots
                table.force_weight[i, c, 0], table.force_weight[i, c, 1] = shares
            place = _place(loaded[:, c], k, u, settings)
            roll_a = _roll(loaded[:, c], path, motion[i], place.a, settings)
            roll_b = _roll(loaded[:, c], path, motion[i], place.b, settings)
            _stand(table, i, c, place, (roll_a, roll_b))
    return table


@inlined
def _stand(table: Commands, i: int, c: int, place: Place, roll: tuple[float, float]) -> None:
    """Knots, weights and offset of finger c at substep i."""
    a, b, w = place.a, place.b, place.share
    table.knot[i, c, 0], table.knot[i, c, 1] = a, b
    table.weight[i, c, 0], table.weight[i, c, 1] = 1 - w, w
    n, m, offset = table.normal[a, c], table.normal[b, c], table.offset[i, c]
    away_a, away_b = (1 - w) * table.lift[a, c] + place.bump_a, w * table.lift[b, c] + place.bump_b
    offset[0] = away_a * n[0] + away_b * m[0]
    offset[1] = away_a * n[1] + away_b * m[1]
    # No slip at the contact point: the centre falls back along the tangent, the normal turned by 90 degrees.
    roll_a, roll_b = (1 - w) * roll[0], w * roll[1]
    offset[0] += roll_a * n[1] + roll_b * m[1]
    offset[1] -= roll_a * n[0] + roll_b * m[0]


@borrowing
def _stand_off(
    world: World,
    pose: np.ndarray,
    position: np.ndarray,
    loaded: bool,
    settings: np.record,
    normal: np.ndarray,
) -> tuple[float, float, float]:
    """Distance that the finger's centre keeps from the planned point along the outward normal, its slope and bend.

    The normal comes back in the frame of the commands.
    """
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = position[0] - pose[0], position[1] - pose[1]
    bx, by = cs * dx + sn * dy, cs * dy - sn * dx
    kind, index, distance = nearest(world.facets, bx, by)
    at_vertex = kind == VERTEX and abs(distance) > 1e-9
    if at_vertex:
        nx, ny = (bx - world.facets[index].x) / distance, (by - world.facets[index].y) / distance
    else:
        nx, ny = world.facets[index].ox, world.facets[index].oy
    if settings.material_point:
        normal[0], normal[1] = nx, ny
    else:
        normal[0], normal[1] = cs * nx - sn * ny, sn * nx + cs * ny
    lift, slope = settings.finger_radius, 0.0
    if not loaded and distance < settings.parking:
        lift, slope = settings.finger_radius + settings.parking - distance, -1.0
    return lift, slope, (lift / distance if at_vertex else 0.0)


@borrowing
def _place(loaded: np.ndarray, k: int, u: float, settings: np.record) -> Place:
    """Where a finger with flags (T,) is at share u of interval k."""
    if loaded[k]:
        return Place(k, k + 1, u, 0.0, 0.0) if loaded[k + 1] else Place(k, k, 0.0, 0.0, 0.0)
    release, approach = k > 0 and loaded[k - 1], loaded[k + 1]
    a, b = k - 1 if release else k, k + 1
    leave = settings.release if release else 0.0
    arrive = 1 - settings.approach if approach else 1.0
    if u < leave:
        return Place(a, a, 0.0, 0.0, 0.0)
    if u >= arrive and approach:
        return Place(b, b, 1.0, 0.0, 0.0)
    x = (u - leave) / (arrive - leave)
    bump = settings.lift_off * np.sin(np.pi * x)
    return Place(a, b, x * x * (3 - 2 * x), bump if release else 0.0, bump if approach else 0.0)


@borrowing
def _push(
    loaded: np.ndarray, c: int, k: int, u: float, settings: np.record
) -> tuple[tuple[int, int], tuple[float, float]]:
    """At share u of interval k: knots a and b and the shares of their forces that finger c exerts.

    Forces balance at the knots, for the fingers loaded there.  Where one comes or goes, all change over at once.
    """
    if not loaded[k, c]:
        if k > 0 and loaded[k - 1, c] and u < settings.release:
            return (k - 1, k - 1), (1 - u / settings.release, 0.0)
        if loaded[k + 1, c]:
            return (k + 1, k + 1), (_late(u, settings.approach), 0.0)
        return (k, k), (0.0, 0.0)
    if not loaded[k + 1, c]:
        return (k, k), (1.0, 0.0)
    begin = 0.0
    if settings.handover and k > 0 and loaded[k - 1, c] and _leaves(loaded, k - 1):
        begin = settings.release
        if u < begin:
            return (k - 1, k), (1 - u / begin, u / begin)
    share = (u - begin) / (1 - begin)
    if settings.handover and _leaves(loaded, k):
        share = 0.0
    elif settings.handover and _arrives(loaded, k):
        share = _late(u, settings.approach)
    return (k, k + 1), (1 - share, share)


@borrowing
def _late(u: float, span: float) -> float:
    """Ramp from 0 to 1 over the last `span` of an interval."""
    if u >= 1:
        return 1.0
    return max(u - (1 - span), 0.0) / span if span > 0 else 0.0


@borrowing
def _leaves(loaded: np.ndarray, k: int) -> bool:
    """Whether some finger pushes for the last time in interval k."""
    return _changes(loaded[k], loaded[k + 1])


@borrowing
def _arrives(loaded: np.ndarray, k: int) -> bool:
    """Whether some finger pushes for the first time at the end of interval k."""
    return _changes(loaded[k + 1], loaded[k])


@borrowing
def _changes(now: np.ndarray, then: np.ndarray) -> bool:
    """Whether some flag is set now and not then."""
    for c in range(len(now)):  # noqa: SIM110  (numba knows no generators here)
        if now[c] and not then[c]:
            return True
    return False


@borrowing
def _roll(loaded: np.ndarray, path: np.ndarray, pose: np.ndarray, t: int, settings: np.record) -> float:
    """Distance that a round finger rolls along the facet since its contact began."""
    if not settings.rolling or not loaded[t]:
        return 0.0
    start = t
    while start > 0 and loaded[start - 1]:
        start -= 1
    return settings.finger_radius * (pose[2] - path[start, 2])
