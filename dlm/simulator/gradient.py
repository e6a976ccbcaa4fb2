"""The simulator as a torch function of finger positions and forces; two ways to differentiate, one interface."""

from typing import Any

import numpy as np
import torch

from dlm.simulator.differences import difference_batch
from dlm.simulator.implicit import implicit_batch
from dlm.simulator.rollout import DONE, UNSOLVED, UNSOLVED_STEP, Plans, execute_batch
from dlm.simulator.scene import SceneBatch
from dlm.simulator.settings import SimulatorSettings
from expert.errors import SolverFailed
from expert.world.values import require


class _Rollout(torch.autograd.Function):
    """Poses at the knots; status rides along without a gradient."""

    @staticmethod
    def forward(
        ctx: Any,
        positions: torch.Tensor,
        forces: torch.Tensor,
        batch: SceneBatch,
        loaded: np.ndarray,
        start: np.ndarray,
        settings: SimulatorSettings,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Poses (B, T, 3), float64, and how each motion ended (B,)."""
        plans = Plans(_array(positions), _array(forces), loaded, start)
        poses, ends = (torch.from_numpy(x) for x in execute_batch(batch.arrays, plans, settings.numbers))
        ctx.problem = batch, plans, settings
        ctx.dtypes = positions.dtype, forces.dtype
        ctx.mark_non_differentiable(ends)
        return poses, ends

    @staticmethod
    def backward(ctx: Any, *adjoints: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        """Gradients of positions and forces, by the settings' method."""
        batch, plans, settings = ctx.problem
        method = implicit_batch if settings.gradient == "implicit" else difference_batch
        gradients = method(batch.arrays, plans, settings.numbers, _array(adjoints[0]))
        to_positions, to_forces = (
            torch.from_numpy(g).to(d) for g, d in zip(gradients, ctx.dtypes, strict=True)
        )
        return to_positions, to_forces, *[None] * 4


def rollout(
    batch: SceneBatch,
    positions: torch.Tensor,
    forces: torch.Tensor,
    settings: SimulatorSettings | None = None,
    contact: torch.Tensor | np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> torch.Tensor:
    """Object poses (B, T, 3), float64, at the knots when plans are executed.

    positions, forces: (B, T, C, 2) [m], [N on the object], world frame.  contact (B, T, C): the finger pushes from this
    knot on; by default where its force is that of a push (`SceneBatch.loaded`).  start (B, 3): first poses, by default the
    desired ones.  Differentiable in positions and forces.  Raises SolverFailed where rounding made a contact problem
    unsolvable; see `rollout_with_status` to go on, and for plans that are not finite.
    """
    poses, ends = _rollout(batch, positions, forces, settings, contact, start)
    if (ends == UNSOLVED).any():
        raise SolverFailed(f"{UNSOLVED_STEP}: scenes {(ends == UNSOLVED).nonzero().flatten().tolist()}")
    return poses


def rollout_with_status(
    batch: SceneBatch,
    positions: torch.Tensor,
    forces: torch.Tensor,
    settings: SimulatorSettings | None = None,
    contact: torch.Tensor | np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    """`rollout` and a status (B,): False where the plan is not finite, numbers overflowed, or a contact problem was unsolvable.

    Such an item keeps its last good pose, has no gradient and leaves the others alone.
    """
    poses, ends = _rollout(batch, positions, forces, settings, contact, start)
    return poses, ends == DONE


def _rollout(
    batch: SceneBatch,
    positions: torch.Tensor,
    forces: torch.Tensor,
    settings: SimulatorSettings | None,
    contact: torch.Tensor | np.ndarray | None,
    start: np.ndarray | None,
) -> tuple[torch.Tensor, torch.Tensor]:
    settings = settings or SimulatorSettings()
    B, T = len(batch), batch.steps
    fits = positions.ndim == 4 and positions.shape[:2] == (B, T) and positions.shape[3] == 2
    require(fits, "positions", f"shape ({B}, {T}, fingers, 2)", tuple(positions.shape))
    require(positions.shape == forces.shape, "forces", f"shape {tuple(positions.shape)}", tuple(forces.shape))
    flags = batch.loaded(_array(forces)) if contact is None else np.asarray(contact, dtype=bool)
    require(flags.shape == positions.shape[:3], "contact", f"shape {tuple(positions.shape[:3])}", flags.shape)
    first = batch.desired[:, 0].copy() if start is None else np.array(start, dtype=float)
    require(first.shape == (B, 3), "start", f"shape ({B}, 3)", first.shape)
    scenes = batch.without_friction() if settings.frictionless else batch
    return _Rollout.apply(positions, forces, scenes, np.ascontiguousarray(flags), first, settings)


def _array(tensor: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().to(torch.float64).cpu().numpy())
