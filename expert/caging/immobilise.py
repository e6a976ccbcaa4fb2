"""Cages around immobilising grasps: fingers at contacts that hold the object still, moved off it by a clearance.

Three fingers  the contacts of a disc that is largest in its neighbourhood (Czyzowicz, Stojmenovic, Urrutia 1999: they
               immobilise).
Two fingers    a reflex corner and the nearest point of an edge, or two reflex corners, where the distance is locally
               least (squeezing) or greatest (stretching).

These are candidates only: every one must be verified.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from expert.geometry.polygon import facet_frames, facets, reflex_vertices, signed_distance
from expert.geometry.pose import Array
from expert.loops.normals import widest_gap

CLEARANCES = (0.04, 0.02, 0.01, 0.005, 0.0025)
"""Tried in this order, relative to the object's size."""
SPANNING = 1e-3
"""Neighbouring directions of three contacts are less than half a turn apart by this angle [rad]."""
STARTS, MOST_TRIPLES = 8, 2000
"""Newton's method starts so often for each triple of features; where there are more of these, for so many at random."""
BATCH = 6
"""So many grasps are tried at all clearances before the next ones are looked at."""


def candidates(vertices: Array, count: int, size: float, rng: np.random.Generator) -> Iterator[Array]:
    """Fingers (count, 2) in the body frame, the loosest first; fingers beyond those that hold it stand near other facets."""
    grasps = itertools.chain(_discs(vertices, rng) if count > 2 else (), _pairs(vertices))
    while batch := list(itertools.islice(grasps, BATCH)):
        for clearance, (contacts, outward) in itertools.product(CLEARANCES, batch):
            fingers = contacts + clearance * size * outward
            spare = _spare(vertices, fingers, count - len(fingers), clearance * size)
            placed = np.concatenate([fingers, spare])
            if len(placed) == count and (signed_distance(vertices, placed) > 0).all():
                yield placed


def _spare(vertices: Array, fingers: Array, count: int, clearance: float) -> Array:
    """Points off the middles of the facets that are farthest from the fingers so far."""
    a, b = facets(vertices)
    edge = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    middles = (a + b) / 2 + clearance * np.column_stack([edge[:, 1], -edge[:, 0]])
    chosen = np.empty((0, 2))
    for _ in range(count):
        taken = np.concatenate([fingers, chosen])
        gaps = np.linalg.norm(middles[:, None] - taken[None], axis=2).min(axis=1)
        chosen = np.concatenate([chosen, middles[[int(gaps.argmax())]]])
    return chosen


def _discs(vertices: Array, rng: np.random.Generator) -> Iterator[tuple[Array, Array]]:
    """Contacts (3, 2) and outward directions of discs in the object that three features hold, the largest first."""
    discs = _tangent_discs(vertices, rng)
    size = float(np.ptp(vertices, axis=0).max())
    exact = np.abs(-signed_distance(vertices, discs[:, :2]) - discs[:, 2]) < 1e-7 * size
    left = discs[exact]
    left = left[np.argsort(-left[:, 2], kind="stable")]
    while len(left):
        disc = left[0]
        yield from _held(vertices, disc[:2], disc[2])
        left = left[np.linalg.norm(left - disc, axis=1) > 1e-3 * size]


def _tangent_discs(vertices: Array, rng: np.random.Generator) -> Array:
    """Centres and radii (k, 3) of discs that touch three features each: facet lines or reflex corners; by Newton's method."""
    inward, _ = facet_frames(vertices)
    corners = vertices[reflex_vertices(vertices)]
    triples = np.array(list(itertools.combinations(range(len(vertices) + len(corners)), 3)))
    if len(triples) > MOST_TRIPLES:
        triples = triples[rng.choice(len(triples), MOST_TRIPLES, replace=False)]
    triples = np.concatenate([triples] * STARTS)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x = np.column_stack([rng.uniform(low, high, (len(triples), 2)), np.zeros(len(triples))])
    for _ in range(12):
        gap = x[:, None, :2] - corners[None]
        length = np.maximum(np.linalg.norm(gap, axis=2, keepdims=True), 1e-12)
        normals = np.concatenate([np.broadcast_to(inward, (len(x), *inward.shape)), gap / length], axis=1)
        to_facets = ((x[:, None, :2] - vertices[None]) * inward).sum(axis=2)
        distances = np.concatenate([to_facets, length[..., 0]], axis=1)
        jacobian = np.take_along_axis(normals, triples[..., None], axis=1)
        jacobian = np.concatenate([jacobian, -np.ones((*triples.shape, 1))], axis=2)
        residual = np.take_along_axis(distances, triples, axis=1) - x[:, 2:]
        regular = np.abs(np.linalg.det(jacobian)) > 1e-9
        x, triples = x[regular], triples[regular]
        x = x - np.linalg.solve(jacobian[regular], residual[regular][..., None])[..., 0]
    return x


def _held(vertices: Array, centre: Array, radius: float) -> Iterator[tuple[Array, Array]]:
    """Triples of contacts of the disc whose directions positively span the plane, the most evenly spread first."""
    nearest = _nearest_on_facets(vertices, centre)
    touching = nearest[np.linalg.norm(nearest - centre, axis=1) <= radius * (1 + 1e-6)]
    points: list[Array] = []
    for p in touching:
        if all(np.linalg.norm(p - q) > 1e-3 * radius for q in points):
            points.append(p)
    triples = np.array(list(itertools.combinations(points, 3))).reshape(-1, 3, 2)
    outward = (triples - centre) / np.linalg.norm(triples - centre, axis=2, keepdims=True)
    widest = np.array([widest_gap(directions) for directions in outward])
    for k in np.argsort(widest, kind="stable"):
        if widest[k] < np.pi - SPANNING:
            yield triples[k], outward[k]


def _nearest_on_facets(vertices: Array, x: Array) -> Array:
    a, b = facets(vertices)
    along = np.clip(((x - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0, 1)
    return a + along[:, None] * (b - a)


def _pairs(vertices: Array) -> Iterator[tuple[Array, Array]]:
    """Contacts (2, 2) and directions in which to move off, where the fingers' distance is locally least or greatest.

    Every cage of a polygon by two fingers can be squeezed or stretched to such contacts (Vahedi, van der Stappen 2008).
    """
    reflex = np.flatnonzero(reflex_vertices(vertices))
    inward, _ = facet_frames(vertices)
    for k in reflex:
        nearest = _nearest_on_facets(vertices, vertices[k])
        for foot, normal in zip(nearest, inward, strict=True):
            away = _direction(foot, vertices[k])
            if abs(away @ normal - 1) < 1e-9 and _opens(vertices, k, away):
                yield np.array([vertices[k], foot]), np.array([away, -away])
        for j in reflex[reflex > k]:
            along = _direction(vertices[j], vertices[k])
            for away in (along, -along):
                if _opens(vertices, k, away) and _opens(vertices, j, -away):
                    yield vertices[[k, j]], np.array([away, -away])


def _direction(a: Array, b: Array) -> Array:
    """Unit vector from a to b; zero where they coincide."""
    return (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)


def _opens(vertices: Array, corner: np.intp, away: Array) -> bool:
    """Whether a finger in a reflex corner moves ahead in direction `away`, or sideways, whichever way it is free to move."""
    v = vertices[corner]
    ahead, behind = vertices[(corner + 1) % len(vertices)], vertices[corner - 1]
    return bool(_direction(v, ahead) @ away > -1e-9 and _direction(v, behind) @ away > -1e-9)
