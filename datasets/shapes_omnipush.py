"""Objects of four sides, each concave, triangular, rectangular or round, as those of the OmniPush data set (Bauza et al., 2019).

A square hub carries one piece on each side; 4^4 combinations, most of them not convex.  Arcs are chains of facets.
"""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from datasets.shapes import check_diameter
from expert.geometry.polygon import diameter, mass_properties
from expert.geometry.pose import Array, rotation
from expert.world.values import readonly, require

Side = Literal["concave", "triangular", "rectangular", "circular"]
SIDES: tuple[Side, ...] = get_args(Side)


@dataclass(frozen=True, kw_only=True)
class OmniPush:
    """A distribution of such objects.

    diameter: range [m].  reach, dent: ranges of how far a piece stands out of the hub, and how deep a concave one goes
    into it, over half the hub's side.  arc: facets of a round or concave side.  facets: least and greatest number that
    this gives.
    """

    diameter: tuple[float, float] = (0.07, 0.10)
    reach: tuple[float, float] = (0.3, 0.7)
    dent: tuple[float, float] = (0.15, 0.35)
    arc: int = 4
    facets: tuple[int, int] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameter", check_diameter(self.diameter))
        # Deeper than 0.4, the arcs of neighbouring sides cross.
        for name, most in (("reach", 1.0), ("dent", 0.4)):
            low, high = readonly(getattr(self, name), (2,), f"shapes.{name}").tolist()
            require(
                0.1 <= low <= high <= most,
                f"shapes.{name}",
                f"0.1 <= least <= greatest <= {most}",
                [low, high],
            )
            object.__setattr__(self, name, (low, high))
        whole = isinstance(self.arc, int) and 2 <= self.arc <= 8
        require(whole, "shapes.arc", "a whole number of facets from 2 to 8", self.arc)
        counts = [len(_side(kind, 0.5, self.arc)) for kind in SIDES]
        object.__setattr__(self, "facets", (4 * min(counts), 4 * max(counts)))

    def sample(self, rng: np.random.Generator) -> Array:
        """Counter-clockwise vertices (V, 2) [m] about the centroid, turned at random."""
        kinds = [SIDES[k] for k in rng.integers(0, len(SIDES), 4)]
        reach = [rng.uniform(*(self.dent if kind == "concave" else self.reach)) for kind in kinds]
        shape = outline(kinds, reach, self.arc)
        shape = shape @ rotation(rng.uniform(0, 2 * np.pi))
        shape *= rng.uniform(*self.diameter) / diameter(shape)
        return shape - mass_properties(shape).centroid


def outline(kinds: list[Side], reach: list[float], arc: int) -> Array:
    """Counter-clockwise polygon (V, 2) of a hub with half side 1, from its lower side on."""
    chains = [
        _side(kind, depth, arc) @ rotation(-k * np.pi / 2)
        for k, (kind, depth) in enumerate(zip(kinds, reach, strict=True))
    ]
    return np.concatenate(chains)


def _side(kind: Side, reach: float, arc: int) -> Array:
    """Points of the lower side from its left corner on, without the right corner."""
    left = [-1.0, -1.0]
    if kind == "triangular":
        return np.array([left, [0.0, -1.0 - reach]])
    if kind == "rectangular":
        # Narrower than the hub, as the pieces are: there is a step at either end.
        return np.array([left, [-0.6, -1.0], [-0.6, -1.0 - reach], [0.6, -1.0 - reach], [0.6, -1.0]])
    sagitta = reach if kind == "circular" else -reach
    radius = (1 + sagitta**2) / (2 * abs(sagitta))
    half = 2 * np.arctan(abs(sagitta))
    angles = np.linspace(-half, half, arc + 1)[:-1]
    x, depth = radius * np.sin(angles), radius * (np.cos(angles) - np.cos(half))
    return np.column_stack([x, -1.0 - np.sign(sagitta) * depth])
