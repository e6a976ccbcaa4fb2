"""Finger paths that meet the thesis's conditions (5-CT12..15, form closure in the end), and that jam all the same."""

import numpy as np

from expert.geometry.pose import Array
from expert.problems.grasp import GraspProblem, schedule
from tests.support.grasps import WIDE, problem_of, shrinking_case
from tests.support.polygons import irregular_polygon

Case = tuple[GraspProblem, Array]

RANDOM = {
    "heptagon, late": (7, np.radians([27, 23, 17, 8, 4])),
    "I, late": (21, WIDE),
    "pentagon": (95, np.radians([51.5, 48, 11, 6.5, 3.2])),
    "quadrangle": (112, WIDE),
    "I, early": (321, WIDE),
    "hourglass": (399, np.radians([31, 28, 24, 18, 5])),
    "M": (414, np.radians([22, 18.5, 14, 8.5, 4.2])),
    "heptagon": (436, np.radians([31, 28.5, 20, 6, 3])),
}
"""Seeds of `shrinking_case`, and half-ranges that hold."""

ANSWERS = {
    "MIQP2's answer": (
        1,
        [
            [
                [-0.048944190412, -0.000805918996],
                [0.000312202423, -0.042807965254],
                [0.041595929545, 0.022776662538],
                [0.010631601319, 0.048904708582],
            ],
            [
                [-0.046605173192, 0.000353720865],
                [0.005860706982, -0.041010636578],
                [0.042527380746, 0.019257646282],
                [0.012630889293, 0.044561735727],
            ],
            [
                [-0.044285368387, 0.001510381609],
                [0.011356936427, -0.039296085491],
                [0.043525518394, 0.015777938927],
                [0.014634978346, 0.040265210675],
            ],
            [
                [-0.042004007606, 0.002661081138],
                [0.016820094019, -0.037670940758],
                [0.044583030054, 0.012355522021],
                [0.016651209266, 0.036006762745],
            ],
            [
                [-0.039771590839, 0.0037989075],
                [0.022265124181, -0.036123721421],
                [0.045688118363, 0.008994159168],
                [0.018686934981, 0.031778059323],
            ],
        ],
    ),
    "another answer of MIQP2": (
        0,
        [
            [
                [-0.055180139095, -0.036206960318],
                [0.024971196463, -0.015608221702],
                [0.025210158065, -0.008305062138],
                [-0.0397034088, 0.038549590068],
            ],
            [
                [-0.054419741891, -0.031206608559],
                [0.022753414504, -0.007575595139],
                [0.022607063982, -0.0137596892],
                [-0.035406801422, 0.037835799346],
            ],
            [
                [-0.053843913417, -0.026363593273],
                [0.020636432775, 0.000465407893],
                [0.020145188901, -0.019138064986],
                [-0.031167644547, 0.037194717353],
            ],
            [
                [-0.053518397092, -0.021664727467],
                [0.018718760321, 0.00852488625],
                [0.017784548177, -0.024476633548],
                [-0.026978719153, 0.036639502291],
            ],
            [
                [-0.053412958691, -0.017053784277],
                [0.017002877543, 0.016569773244],
                [0.015485258393, -0.02981179913],
                [-0.022832856452, 0.036183398226],
            ],
        ],
    ),
}
"""Random polygons of Fig. 5-28, and what the thesis's model proposes for them at 45 degrees: finger paths [m]."""


def jams() -> dict[str, Case]:
    """All of them by name."""
    cases = {name: shrinking_case(seed, half_ranges) for name, (seed, half_ranges) in RANDOM.items()}
    for name, (k, path) in ANSWERS.items():
        vertices = irregular_polygon(np.random.default_rng(k), 4 + k % 3)
        cases[name] = problem_of(vertices, half_ranges=np.radians(schedule(45.0))), np.array(path)
    return cases
