"""The simulator as a torch function of finger positions and forces; two ways to differentiate, one interface."""

from typing import Any

import numpy as np
import torch

from dlm.simulator.adjoint import implicit_batch
from dlm.simulator.differences import difference_batch
from dlm.simulator.rollout import execute_batch
from dlm.simulator.scene import SceneBatch
from dlm.simulator.settings import SimulatorSettings
from expert.world.values import require

LOADED_SHARE = 1e-6
"""Without contact flags a finger counts as loaded where its force exceeds this share of the object's weight."""


def loaded_flags(batch: SceneBatch, forces: np.ndarray) -> np.ndarray:
    """Flags (B, T, C): the finger's force (B, T, C, 2) is not zero."""
    weight = np.maximum(batch.arrays.mass * 9.81, 1e-300)[:, None, None]
    with np.errstate(invalid="ignore", over="ignore"):
        return np.abs(forces).max(axis=-1) > LOADED_SHARE * weight


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
        """Poses (B, T, 3), float64, and status (B,)."""
        p, f = _array(positions), _array(forces)
        poses, ok = execute_batch(batch.arrays, settings.physics, settings.layers, p, f, loaded, start)
        ctx.problem = batch, p, f, loaded, start, settings
        ctx.dtypes = positions.dtype, forces.dtype
        ok_tensor = torch.from_numpy(ok)
        ctx.mark_non_differentiable(ok_tensor)
        return torch.from_numpy(poses), ok_tensor

    @staticmethod
    def backward(ctx: Any, *adjoints: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        """Gradients of positions and forces, by the settings' method."""
        batch, p, f, loaded, start, settings = ctx.problem
        common = batch.arrays, settings.physics, settings.layers, p, f, loaded, start, _array(adjoints[0])
        if settings.gradient == "implicit":
            d_positions, d_forces = implicit_batch(*common)
        else:
            d_positions, d_forces = difference_batch(*common, settings.difference_step)
        to_p, to_f = ctx.dtypes
        return torch.from_numpy(d_positions).to(to_p), torch.from_numpy(d_forces).to(to_f), *[None] * 4


def rollout(
    batch: SceneBatch,
    positions: torch.Tensor,
    forces: torch.Tensor,
    settings: SimulatorSettings | None = None,
    contact: torch.Tensor | np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> torch.Tensor:
    """Object poses (B, T, 3), float64, at the knots when plans are executed (Thesis 4-CT8).

    positions, forces: (B, T, C, 2) [m], [N on the object], world frame.  contact (B, T, C): the finger pushes from this
    knot on; by default where its force is not zero.  start (B, 3): first poses, by default the desired ones.
    Differentiable in positions and forces.  See `rollout_with_status` for plans that are not finite.
    """
    return rollout_with_status(batch, positions, forces, settings, contact, start)[0]


def rollout_with_status(
    batch: SceneBatch,
    positions: torch.Tensor,
    forces: torch.Tensor,
    settings: SimulatorSettings | None = None,
    contact: torch.Tensor | np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    """`rollout` and a status (B,): False where the plan is not finite or numbers overflowed.

    Such an item keeps its last finite pose, has no gradient and leaves the others alone.
    """
    settings = settings or SimulatorSettings()
    B, T = len(batch), batch.steps
    fits = positions.ndim == 4 and positions.shape[:2] == (B, T) and positions.shape[3] == 2
    require(fits, "positions", f"shape ({B}, {T}, fingers, 2)", tuple(positions.shape))
    require(positions.shape == forces.shape, "forces", f"shape {tuple(positions.shape)}", tuple(forces.shape))
    flags = loaded_flags(batch, _array(forces)) if contact is None else np.asarray(contact, dtype=bool)
    require(flags.shape == positions.shape[:3], "contact", f"shape {tuple(positions.shape[:3])}", flags.shape)
    first = batch.desired[:, 0].copy() if start is None else np.array(start, dtype=float)
    require(first.shape == (B, 3), "start", f"shape ({B}, 3)", first.shape)
    scenes = batch.without_friction() if settings.frictionless else batch
    poses, ok = _Rollout.apply(positions, forces, scenes, np.ascontiguousarray(flags), first, settings)
    return poses, ok


def _array(tensor: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().to(torch.float64).cpu().numpy())
