"""Contact sets at the fractions and angles that the equations name: some position lets every contact touch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.geometry.pose import Array, rotation
from expert.verify.grasp.closing_equations import ContactSet, Segment, balances, closing_poses, spans
from expert.verify.grasp.finger_path import Facets
from expert.world.named import named_shape
from tests.support.polygons import random_polygon


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 4))
def test_balances_are_all_null_vectors(seed: int, count: int) -> None:
    angles = np.random.default_rng(seed).integers(0, 12, count) * np.pi / 6  # some are parallel
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    basis = balances(normals)
    rank = np.linalg.matrix_rank(normals, tol=1e-6)
    assert len(basis) == count - rank
    assert np.abs(basis @ normals).max(initial=0) <= 1e-12
    assert np.linalg.matrix_rank(basis) == len(basis) if len(basis) else True


def misfit(facets: Facets, contacts: ContactSet, fingers: Array, angle: float) -> float:
    """Least over positions x of the largest gap |n.R^T (p - x) - d|, by least squares over the contacts."""
    world = facets.normals[contacts.facets] @ rotation(angle).T
    right = (world * fingers[contacts.fingers]).sum(axis=1) - facets.offsets[contacts.facets]
    x = np.linalg.lstsq(world, right, rcond=None)[0]
    return float(np.abs(world @ x - right).max())


@pytest.mark.parametrize("count", [3, 4])
def test_all_contacts_touch_at_the_poses_found(count: int) -> None:
    rng, seen = np.random.default_rng(count), 0
    for _ in range(400):
        facets = Facets.of(random_polygon(rng, 6) / 0.05)
        touched = rng.integers(0, 6, count)
        normals = facets.normals[touched]
        if not spans(normals):
            continue
        contacts = ContactSet(np.arange(count), touched, balances(normals))
        start, stop = 2 * rng.normal(size=(2, count, 2))
        for fraction, angle in closing_poses(contacts, facets, Segment(start, stop - start)):
            seen += 1
            assert misfit(facets, contacts, start + fraction * (stop - start), angle) <= 1e-6
    assert seen > 20


def test_parallel_sides_close_when_fingers_are_their_distance_apart() -> None:
    facets = Facets.of(named_shape("I") / 0.05)
    up, down = (int(np.argmax(facets.normals[:, 1] == sign)) for sign in (1, -1))
    width = facets.offsets[up] + facets.offsets[down]
    contacts = ContactSet(np.arange(2), np.array([up, down]), balances(facets.normals[[up, down]]))
    start = np.array([[0, width], [0, -width]])
    poses = closing_poses(contacts, facets, Segment(start, -start))
    assert poses[:, 0] == pytest.approx([0.5])
    assert np.cos(poses[:, 1]) == pytest.approx([1.0])
