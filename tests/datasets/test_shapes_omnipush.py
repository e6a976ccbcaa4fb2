"""Objects of four sides, each of one of four kinds."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.generation import Generation, generate
from datasets.shapes_omnipush import SIDES, OmniPush, outline
from datasets.specification import Specification
from datasets.store import read_dataset
from expert.errors import InvalidProblem
from expert.geometry.polygon import (
    diameter,
    is_convex,
    mass_properties,
    reflex_vertices,
    signed_area,
    simple_polygon,
)


def test_all_combinations_are_simple_at_all_depths() -> None:
    for kinds in itertools.product(SIDES, repeat=4):
        for reach, dent in itertools.product((0.1, 1.0), (0.1, 0.4)):
            depths = [dent if kind == "concave" else reach for kind in kinds]
            vertices = outline(list(kinds), depths, 8)
            assert np.array_equal(simple_polygon(vertices, field="object"), vertices)


def test_each_kind_does_to_the_hub_what_its_name_says() -> None:
    def alone(kind: str) -> np.ndarray:
        return outline([kind, *["triangular"] * 3], [0.4] * 4, 6)  # type: ignore[list-item]

    plain = signed_area(alone("triangular"))
    assert signed_area(alone("concave")) < plain < signed_area(alone("circular"))
    assert signed_area(alone("rectangular")) == pytest.approx(plain - 0.4 + 1.2 * 0.4)
    assert is_convex(alone("triangular"))
    assert reflex_vertices(alone("rectangular")).sum() == 2
    assert reflex_vertices(alone("concave")).sum() == 5
    arc = alone("circular")[:7]
    centre = np.array([0.0, -1 + (1 - 0.4**2) / 0.8])
    assert np.allclose(np.linalg.norm(arc[:6] - centre, axis=1), (1 + 0.4**2) / 0.8)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_samples_keep_what_the_family_promises(seed: int) -> None:
    family = OmniPush()
    vertices = family.sample(np.random.default_rng(seed))
    assert np.array_equal(simple_polygon(vertices, field="object"), vertices)
    assert family.facets[0] <= len(vertices) <= family.facets[1]
    assert family.diameter[0] <= diameter(vertices) <= family.diameter[1]
    assert np.abs(mass_properties(vertices).centroid).max() < 1e-12


def test_most_are_not_convex() -> None:
    rng = np.random.default_rng(0)
    assert np.mean([is_convex(OmniPush().sample(rng)) for _ in range(200)]) < 0.3


def test_the_data_set_is_made_and_read_back(
    configured: Callable[[str], Specification], tmp_path: Path
) -> None:
    specification = replace(configured("omnipush"), count=2, shard=2)
    manifest = generate(Generation(specification=specification, seed=0, out=tmp_path / "omni", jobs=1))
    data = read_dataset(tmp_path / "omni")
    assert manifest["tasks"] == len(data) == 2
    assert manifest["draws"] == 2 + len(manifest["failed_draws"])
    assert [len(data[k].task.body.vertices) for k in range(2)] == data.arrays["vertex_count"].tolist()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"diameter": (0.1, 0.05)}, "shapes.diameter"),
        ({"reach": (0.5, 2.0)}, "shapes.reach"),
        ({"dent": (0.2, 0.6)}, "shapes.dent"),
        ({"dent": (0.3, 0.2)}, "shapes.dent"),
        ({"arc": 1}, "shapes.arc"),
        ({"arc": 2.5}, "shapes.arc"),
    ],
)
def test_senseless_limits_are_refused_by_name(change: dict, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected "):
        OmniPush(**change)
