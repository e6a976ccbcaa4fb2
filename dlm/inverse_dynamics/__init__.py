"""Differentiable inverse dynamics (Thesis 4-CT6): mechanical parameters in, finger positions and forces out."""

from dlm.inverse_dynamics.layer import Action, InverseDynamics

__all__ = ["Action", "InverseDynamics"]
