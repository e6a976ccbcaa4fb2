"""A pentagon on its way, and what a camera sees of it."""

from dataclasses import replace

import numpy as np

from dlm.perception.fit import (
    MovingPolygon,
    Observation,
    modelled,
)

PENTAGON = np.array([[5.0, 6.0], [14.0, 6.0], [17.0, 11.0], [10.0, 17.0], [4.0, 12.0]])


MOTION = np.array([[0.0, 0.0, 0.0], [0.4, 1.3, 0.2], [1.2, 2.1, 0.5]])


TRUTH = MovingPolygon(PENTAGON, MOTION, np.array([10.0, 10.0]))


def observed(scene: MovingPolygon, blur: float = 0.0, deviation: float = 0.01, seed: int = 0) -> Observation:
    """What a camera with some noise sees of it."""
    blank = np.zeros((len(scene.motion), 28, 28))
    seen = Observation(blank, blank + deviation**-2, np.zeros((len(blank), 2)), blur)
    share, _ = modelled(scene, seen)
    return replace(seen, share=share + np.random.default_rng(seed).normal(0, deviation, share.shape))
