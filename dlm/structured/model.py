"""`model: structured`: video to geometry, geometry to contact classes, classes to a checked plan."""

from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np
import torch

from datasets.parameters import MechanicalParameters, parameters_of
from datasets.render import Camera, Frames
from dlm.inverse_dynamics.layer import Action
from dlm.perception import Perceived, PerceptionSettings, perceive
from dlm.structured.calibration import Calibration, deflated
from dlm.structured.planners import Answer, ClassPlanner, Planner
from dlm.structured.planning import Planning
from expert.errors import InvalidProblem, SolverFailed
from expert.problems.contact import ContactTask, Plan

Status = Literal["planned", "risky", "poor_fit", "no_plan"]


@dataclass(frozen=True, kw_only=True)
class Planned:
    """Answer to a video.

    status: planned; risky (the best plan fails when it is tried out on what was perceived); poor_fit (there is a plan, but the video is not explained by what was perceived); no_plan (none was
    found, which does not prove that there is none).  reason: in words.  task: what was planned for, None where the
    geometry makes no task.  checked: contact classes looked at.
    """

    perceived: Perceived
    status: Status
    reason: str = ""
    plan: Plan | None = None
    task: ContactTask | None = None
    checked: int = 0

    @property
    def parameters(self) -> MechanicalParameters | None:
        """P(t) at which 4-CT6 has the plan as its optimum; None where there is no plan."""
        return (
            parameters_of(self.task, self.plan) if self.plan is not None and self.task is not None else None
        )

    def action(self) -> Action:
        """As a batch of one; zeros and solved = False where there is no plan."""
        shape = (len(self.perceived.poses), 2, 2)
        found = self.plan is not None
        arrays = (self.plan.positions, self.plan.forces) if self.plan is not None else (np.zeros(shape),) * 2
        positions, forces = (torch.from_numpy(np.array(a, dtype=float))[None] for a in arrays)
        return Action(
            positions=positions,
            forces=forces,
            slack=torch.zeros(1, shape[0], 3, dtype=torch.float64),
            solved=torch.tensor([found]),
        )


class Perceive(Protocol):
    """`dlm.perception.perceive`, or something that remembers its answers."""

    def __call__(self, video: Frames, camera: Camera, settings: PerceptionSettings) -> Perceived: ...


@dataclass(frozen=True, kw_only=True)
class StructuredModel:
    """camera and perception: as `perceive` is told; planning: margins; planner: how a plan is found; inflation: see Calibration."""

    camera: Camera = field(default_factory=Camera)
    perception: PerceptionSettings = field(default_factory=PerceptionSettings)
    planning: Planning = field(default_factory=Planning)
    planner: Planner = field(default_factory=ClassPlanner)
    inflation: float = 0.0
    perceive: Perceive = perceive

    def calibrated(self, calibration: Calibration) -> "StructuredModel":
        """With corrections, each kept to what makes sense."""
        c, tasks, camera = calibration, self.planning.tasks, self.camera
        planned = replace(
            tasks,
            facet_margin=float(np.clip(tasks.facet_margin + c.margin, 0.0, 0.45)),
            cone_fraction=float(np.clip(tasks.cone_fraction + c.cone, 0.2, 1.0)),
            least_push=float(np.clip(tasks.least_push + c.push, 0.0, 1.0)),
        )
        height = camera.size * camera.scale
        return replace(
            self,
            camera=replace(
                camera,
                centre=camera.centre + c.shift_x,
                below=float(np.clip(camera.below - c.shift_y, 0.0, 0.99 * height)),
            ),
            perception=replace(self.perception, blur=float(np.clip(self.perception.blur + c.blur, 0.0, 5.0))),
            planning=replace(self.planning, tasks=planned),
            inflation=self.inflation + c.inflation,
        )

    def act(self, video: Frames) -> Planned:
        """Perceive and plan.  Raises InvalidProblem for a video without one object that stays in view."""
        seen = self.perceive(video, self.camera, self.perception)
        return self.plan(deflated(seen, self.inflation))

    def plan(self, perceived: Perceived) -> Planned:
        """Plan for perceived geometry.  Raises InvalidProblem for another number of frames than planned for."""
        checked, best = 0, None
        try:
            for planning in self.planning.variants():
                answer = self.planner(planning.of(perceived))
                checked += answer.checked
                if answer.plan is not None and (best is None or answer.risk < best.risk):
                    best = answer
                if best is not None and best.risk <= self.planner.acceptable:
                    break
        except InvalidProblem as error:
            if error.field == "poses":
                raise
            return Planned(perceived=perceived, status="no_plan", reason=str(error), checked=checked)
        except SolverFailed as error:
            return Planned(perceived=perceived, status="no_plan", reason=str(error), checked=checked)
        if best is None:
            reason = f"no plan among {checked} checked contact classes"
            return Planned(perceived=perceived, status="no_plan", reason=reason, checked=checked)
        return self._answer(perceived, best, checked)

    def _answer(self, perceived: Perceived, answer: Answer, checked: int) -> Planned:
        status: Status = "planned"
        reason = ""
        if answer.risk > self.planner.acceptable:
            status, reason = "risky", f"in trial simulations it fails, with a risk of {answer.risk:.2g} cm^2"
        if perceived.status != "ok":
            status, reason = "poor_fit", perceived.reason
        return Planned(
            perceived=perceived,
            status=status,
            reason=reason,
            plan=answer.plan,
            task=answer.task,
            checked=checked,
        )
