"""`model: structured`: perceived geometry, contact classes proposed by a network, and convex checks that choose among them."""

from dlm.structured.classes import Schedules
from dlm.structured.model import Planned, StructuredModel
from dlm.structured.planners import ClassPlanner, ExpertPlanner
from dlm.structured.planning import Planning
from dlm.structured.trial import Trial

__all__ = ["ClassPlanner", "ExpertPlanner", "Planned", "Planning", "Schedules", "StructuredModel", "Trial"]
