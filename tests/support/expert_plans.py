"""Feasible tasks with the expert's plans: the six sagittal families, and pushes and turns on a table."""

from dataclasses import dataclass, replace

import numpy as np

from datasets.label import Label, Labelling, label
from datasets.motions import FAMILIES, TaskSettings, sample_task
from datasets.shapes import Shapes, sample_polygon
from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask, Plan
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body


@dataclass(frozen=True)
class Planned:
    """A task, its plan, and the family that it was drawn from."""

    family: str
    task: ContactTask
    plan: Plan


def planned_tasks(count: int, facets: tuple[int, int], seed: int) -> tuple[list[Planned], int]:
    """So many labelled sagittal tasks, the families in turn, and the number of draws that had no plan."""
    shapes, tasks = Shapes(facets=facets), TaskSettings()
    found: list[Planned] = []
    draws = 0
    while len(found) < count:
        family = list(FAMILIES)[len(found) % len(FAMILIES)]
        rng = np.random.default_rng([seed, facets[0], draws])
        draws += 1
        try:
            answer = label(sample_task(rng, family, shapes, tasks), Labelling())
        except InvalidProblem:
            continue
        if isinstance(answer, Label):
            found.append(Planned(family, answer.task, answer.plan))
    return found, draws - count


def transverse_tasks(count: int, seed: int) -> tuple[list[Planned], int]:
    """So many labelled tasks on a table: 1 to 3 cm in some direction, turning by up to 0.3 rad."""
    found: list[Planned] = []
    draws = 0
    template = TaskSettings()
    while len(found) < count:
        rng = np.random.default_rng([seed, draws])
        draws += 1
        body, _ = Body.uniform(sample_polygon(rng, Shapes()), template.mass)
        way = rng.uniform(0, 2 * np.pi)
        goal = np.array(
            [*(rng.uniform(0.01, 0.03) * np.array([np.cos(way), np.sin(way)])), rng.uniform(-0.3, 0.3)]
        )
        share = np.linspace(0, 1, template.steps)
        poses = (share * share * (3 - 2 * share))[:, None] * goal
        motion = Trajectory.of(poses, template.dt, "rest")
        table = Environment(plane="transverse", support_friction=0.3)
        aloft = Trajectory.of(
            poses + [0, 1, 0], template.dt, "rest"
        )  # clear of the template's floor, which goes
        task = replace(template.task(body, aloft), environment=table, trajectory=motion)
        answer = label(task, Labelling())
        if isinstance(answer, Label):
            found.append(Planned("table", answer.task, answer.plan))
    return found, draws - count
