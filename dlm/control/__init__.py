"""Closed loop: perceive, plan, act, perceive again."""

from dlm.control.policy import PushPolicy

__all__ = ["PushPolicy"]
