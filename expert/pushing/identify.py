"""What a block is like, from pushes that were seen: centre of gravity, gyration, sliding on; least squares through the model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expert.geometry.pose import Array, wrapped
from expert.pushing.impulse_model import ImpulseModel, shifted
from expert.pushing.impulses import ANGLE, Block, Law, X, trace

LEVER = 45.0
"""Length at which an angle's error counts like a position's."""
NUDGES = np.array([1.0, 1.0, 0.05, 0.3])
"""Differences: centre (2) [length], logarithm of the gyration, sliding [substeps]."""
WIDTHS = np.array([20.0, 20.0, 0.5, 30.0])
"""How far from the first guess is still likely (standard deviations)."""
MOST_SLIDING = 60.0
NOISE = 0.5
"""Of seen poses [length]."""
STUCK = 1e4
"""No step is found where the damping exceeds this."""


@dataclass(frozen=True)
class Seen:
    """A push that was seen: pose (3,) at rest, the finger's position and velocity (2,), commands (n, 2), poses after each (n, 3)."""

    pose: Array
    position: Array
    velocity: Array
    commands: Array
    poses: Array


def deviation(model: ImpulseModel, push: Seen) -> Array:
    """Seen minus predicted poses (n, 3); the angle in lengths, at a lever of LEVER."""
    return _deviation(model.law, model.offset, model.drive.substeps, push)


def _deviation(law: Law, offset: Array, substeps: int, push: Seen) -> Array:
    """By a law about the centre of gravity at `offset` (2,) in the frame of the poses."""
    state = np.zeros(13)
    state[:2], state[2:4], state[X : ANGLE + 1] = push.position, push.velocity, shifted(push.pose, offset)
    rows = push.poses - shifted(trace(law, state, push.commands, substeps), -offset)
    rows[:, 2] = LEVER * wrapped(rows[:, 2])
    return rows


def misfit(model: ImpulseModel, push: Seen) -> float:
    """Largest root-mean-square deviation over the steps of a push [length]."""
    return float(np.sqrt((deviation(model, push) ** 2).sum(1).max()))


def identified(model: ImpulseModel, pushes: Sequence[Seen], first: Block, rounds: int = 12) -> ImpulseModel:
    """The model of the block that explains all pushes best, near the first guess where they say little."""
    guess = _numbers(first)
    at = _numbers(model.block)
    residual, damping = _residual(model, at, pushes, guess), 1e-2
    for _ in range(rounds):
        slopes = np.stack(
            [(_residual(model, at + d, pushes, guess) - residual) for d in np.diag(NUDGES)], axis=1
        )
        normal = slopes.T @ slopes
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), slopes.T @ residual) * NUDGES
        trial = at + np.clip(step, -25 * NUDGES, 25 * NUDGES)
        trial[3] = np.clip(trial[3], 0, MOST_SLIDING)
        found = _residual(model, trial, pushes, guess)
        if found @ found < residual @ residual:
            at, residual, damping = trial, found, damping / 4
        else:
            damping *= 8
        if damping > STUCK:
            break
    return replace(model, block=_block(first, at))


def _numbers(block: Block) -> Array:
    return np.array([*block.centre, np.log(block.gyration), block.kept / (1 - block.kept)])


def _block(like: Block, numbers: Array) -> Block:
    sliding = max(numbers[3], 0.0)
    return replace(like, centre=numbers[:2], gyration=float(np.exp(numbers[2])), kept=sliding / (1 + sliding))


def _residual(model: ImpulseModel, numbers: Array, pushes: Sequence[Seen], guess: Array) -> Array:
    """Deviations in units of the noise, large ones tamed, and distance from the first guess in units of its width."""
    block = _block(model.block, numbers)
    edges = model.law.edges._replace(starts=model.law.edges.starts + model.block.centre - block.centre)
    law = model.law._replace(edges=edges, gyration=block.gyration, kept=block.kept)
    offset, substeps = block.centre - model.origin, model.drive.substeps
    rows = np.concatenate([_deviation(law, offset, substeps, push).ravel() for push in pushes]) / NOISE
    tamed = np.sign(rows) * np.minimum(np.abs(rows), np.sqrt(np.abs(rows) * 30))
    return np.concatenate([tamed, (numbers - guess) / WIDTHS])
