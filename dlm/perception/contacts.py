"""Contact with the floor: vertices that the data cannot tell from touching it do touch it, and stay where they seem to."""

from dataclasses import dataclass, replace

import numpy as np

from dlm.perception.fit import (
    LEAST_DAMPING,
    LONGEST_STEP,
    MovingPolygon,
    Observation,
    Quadratic,
    fit,
    quadratic,
)
from dlm.perception.prune import boundary_variance, without_tangles
from expert.geometry.pose import Array

ITERATIONS = 12
EXACT = 1e-9
"""What touches the floor is this close to it [pixels]."""
SIGNIFICANT = 3.0
"""A gap or slip of so many standard deviations is one."""
SYSTEMATIC_GAP, SYSTEMATIC_SLIP = 0.01, 0.02
"""Standard deviations of a vertex's height and place along the floor beyond what pixel noise explains [pixels]."""


@dataclass(frozen=True)
class Contact:
    """Vertex `vertex` touches the floor at step `step`, or (`sticks`) does not slip from there to the next step."""

    step: int
    vertex: int
    sticks: bool = False

    @property
    def systematic(self) -> float:
        """What is left of its gap or slip without pixel noise [pixels]."""
        return SYSTEMATIC_SLIP if self.sticks else SYSTEMATIC_GAP


def snap_contacts(scene: MovingPolygon, seen: Observation, floor: float, reach: float) -> MovingPolygon:
    """Fit again under the contacts that the data allows; nothing enters the floor Y = `floor` [pixels]."""
    for _ in range(len(scene.vertices)):
        snapped = _snapped(scene, seen, floor, reach)
        simpler = without_tangles(_without_straight_corners(snapped.vertices, floor))
        if len(simpler) == len(snapped.vertices):
            return snapped
        scene, _ = fit(replace(snapped, vertices=simpler), seen)
    return snapped


def _without_straight_corners(vertices: Array, floor: float) -> Array:
    """Without what lies on the floor between two others."""
    down = np.abs(vertices[:, 1] - floor) < EXACT
    return vertices[~(down & np.roll(down, 1) & np.roll(down, -1))]


def _snapped(scene: MovingPolygon, seen: Observation, floor: float, reach: float) -> MovingPolygon:
    contacts: list[Contact] = []
    for candidates in (_touching, _sticking):
        value = quadratic(scene, seen)
        _, variance = boundary_variance(scene, seen)
        contacts = contacts + candidates(scene, contacts, _covariance(value, variance), floor, reach)
        scene, contacts = _settle(scene, seen, contacts, floor, variance)
    return scene


def _settle(
    scene: MovingPolygon, seen: Observation, contacts: list[Contact], floor: float, variance: float
) -> tuple[MovingPolygon, list[Contact]]:
    """Fit under contacts; give up, one by one, those that the data contradicts, and add what would enter the floor."""
    for _ in range(4 * scene.motion.size):
        scene, free, deviation = _fit_under(scene, seen, contacts, floor, variance)
        heights = scene.placed()[..., 1] - floor
        inside = [Contact(int(t), int(k)) for t, k in np.argwhere(heights < -EXACT)]
        if new := [c for c in inside if c not in contacts]:
            contacts = contacts + new
            continue
        excess = np.array(
            [
                (abs(x) if c.sticks else x) / np.hypot(s, c.systematic)
                for c, x, s in zip(contacts, free, deviation, strict=True)
            ]
        )
        if not len(excess) or excess.max() < SIGNIFICANT:
            break
        lost = contacts[int(excess.argmax())]
        contacts = [c for c in contacts if not _rests_on(c, lost)]
    return scene, contacts


def _rests_on(contact: Contact, lost: Contact) -> bool:
    """Whether it cannot be without the lost one: sticking needs touching at both steps."""
    held = contact.sticks and contact.vertex == lost.vertex and lost.step in (contact.step, contact.step + 1)
    return contact == lost or (held and not lost.sticks)


def _fit_under(
    scene: MovingPolygon, seen: Observation, contacts: list[Contact], floor: float, variance: float
) -> tuple[MovingPolygon, Array, Array]:
    """Gauss-Newton under equality; with it the value each constraint would take if it alone were lifted, and its deviation."""
    for _ in range(ITERATIONS):
        values, slopes = _constraints(scene, contacts, floor)
        here = quadratic(scene, seen)
        size = len(here.gradient)
        matrix = here.matrix + LEAST_DAMPING * np.diag(here.matrix).mean() * np.eye(size)
        inverse = np.linalg.inv(matrix)
        spread = np.linalg.pinv(slopes @ inverse @ slopes.T, rcond=1e-9, hermitian=True)
        pull = spread @ (values - slopes @ inverse @ here.gradient)
        step = -inverse @ (here.gradient + slopes.T @ pull)
        scene = scene.moved(step * min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12)))
        if np.abs(step).max() < 1e-6:
            break
    stiffness = np.maximum(np.diag(spread), 1e-12)
    return scene, pull / stiffness, np.sqrt(variance / stiffness)


def _constraints(scene: MovingPolygon, contacts: list[Contact], floor: float) -> tuple[Array, Array]:
    """Gaps and slips (K,) [pixels] and their derivatives (K, n)."""
    placed, slope = scene.placed(), scene.derivative()
    values, slopes = np.zeros(len(contacts)), np.zeros((len(contacts), slope.shape[-1]))
    for row, c in enumerate(contacts):
        t, k = c.step, c.vertex
        if c.sticks:
            values[row] = placed[t + 1, k, 0] - placed[t, k, 0]
            slopes[row] = slope[t + 1, k, 0] - slope[t, k, 0]
        else:
            values[row], slopes[row] = placed[t, k, 1] - floor, slope[t, k, 1]
    return values, slopes


def _covariance(value: Quadratic, variance: float) -> Array:
    size = len(value.gradient)
    return variance * np.linalg.inv(
        value.matrix + LEAST_DAMPING * np.diag(value.matrix).mean() * np.eye(size)
    )


def _touching(
    scene: MovingPolygon, contacts: list[Contact], covariance: Array, floor: float, reach: float
) -> list[Contact]:
    every = [Contact(t, k) for t in range(len(scene.motion)) for k in range(len(scene.vertices))]
    return _insignificant(scene, every, covariance, floor, reach)


def _sticking(
    scene: MovingPolygon, contacts: list[Contact], covariance: Array, floor: float, reach: float
) -> list[Contact]:
    steady = [Contact(c.step, c.vertex, True) for c in contacts if Contact(c.step + 1, c.vertex) in contacts]
    return _insignificant(scene, steady, covariance, floor, reach)


def _insignificant(
    scene: MovingPolygon, contacts: list[Contact], covariance: Array, floor: float, reach: float
) -> list[Contact]:
    """Those whose gap or slip is small and not significant."""
    values, slopes = _constraints(scene, contacts, floor)
    systematic = np.array([c.systematic for c in contacts])
    deviation = np.sqrt(np.einsum("kn,nm,km->k", slopes, covariance, slopes) + systematic**2)
    size = np.where([c.sticks for c in contacts], np.abs(values), values)
    return [
        c
        for c, x, s in zip(contacts, size, deviation, strict=True)
        if x < min(reach, (SIGNIFICANT + 0.5) * s)
    ]
