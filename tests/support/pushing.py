"""What the tests of pushing share."""

import numpy as np

from expert.pushing.drive import Drive
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.impulses import Block
from expert.world.shape import Shape

TEE = Shape.of_pieces(
    [[(-60, 0), (60, 0), (60, 30), (-60, 30)], [(-15, 30), (15, 30), (15, 120), (-15, 120)]]
)
SQUARE = Shape(vertices=[[-30, -30], [30, -30], [30, 30], [-30, 30]])


def tee_model() -> ImpulseModel:
    """gym-pusht's T and agent."""
    return ImpulseModel(Block(shape=TEE, centre=np.array([0.0, 45.0]), gyration=3000.0), Drive())


def square_model() -> ImpulseModel:
    """A square of uniform density."""
    return ImpulseModel(Block(shape=SQUARE, centre=np.zeros(2), gyration=600.0), Drive())
