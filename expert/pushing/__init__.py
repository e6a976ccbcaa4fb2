"""Pushing a polygon with a disc: models of contact, tables of pushes, search in time.  See docs/theory/pushing.md.

Lengths may be in any one unit; the world of Push-T is in pixels of its surface.
"""

from expert.pushing.drive import Drive
from expert.pushing.goal import Goal
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.impulses import Block
from expert.pushing.planner import Effort, Plan, Planner, Workspace
from expert.pushing.table import Grid, Table, push_table

__all__ = [
    "Block",
    "Drive",
    "Effort",
    "Goal",
    "Grid",
    "ImpulseModel",
    "Plan",
    "Planner",
    "Table",
    "Workspace",
    "push_table",
]
