"""Executing actions: one way into the simulator for every architecture, and for the expert."""

import torch
from torch import Tensor

from dlm.inverse_dynamics.layer import Action
from dlm.simulator import SimulatorSettings
from dlm.simulator.gradient import rollout
from dlm.tasks import TaskBatch

AWAY = 1.0
"""Height at which idle fingers wait [m]."""


def simulate(action: Action, tasks: TaskBatch, simulator: SimulatorSettings) -> Tensor:
    """Object poses (b, t, 3) that follow; differentiable in the action's positions and forces (Thesis 4-CT8)."""
    return rollout(tasks.scenes, action.positions, action.forces, simulator)


def idle_action(tasks: TaskBatch) -> Action:
    """No action: the fingers wait out of reach."""
    positions = torch.zeros_like(tasks.positions)
    positions[..., 0] = 0.1 * torch.arange(positions.shape[2])
    positions[..., 1] = AWAY
    return given_action(positions, torch.zeros_like(tasks.forces))


def expert_action(tasks: TaskBatch) -> Action:
    """The expert's plan, found with all true parameters: the oracle."""
    return given_action(tasks.positions, tasks.forces)


def given_action(positions: Tensor, forces: Tensor) -> Action:
    """Positions and forces (b, t, c, 2) that no program had to be solved for."""
    return Action(
        positions=positions,
        forces=forces,
        slack=torch.zeros(*positions.shape[:2], 3, dtype=torch.float64),
        solved=torch.ones(len(positions), dtype=torch.bool),
    )


def idle_where_unsolved(action: Action, tasks: TaskBatch) -> Action:
    """The action, with idle fingers in tasks whose program was not solved."""
    idle, solved = idle_action(tasks), action.solved[:, None, None, None]
    return Action(
        positions=torch.where(solved, action.positions, idle.positions),
        forces=torch.where(solved, action.forces, idle.forces),
        slack=action.slack,
        solved=action.solved,
    )
