"""What a data set is to hold, and how one task of it is drawn: everything follows from the specification and a seed."""

import dataclasses
import zlib
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from datasets.label import Labelling, Refusal, label
from datasets.limits import Number, check_numbers
from datasets.motions import FAMILIES, NoRoom, TaskSettings, sample_task
from datasets.parameters import MechanicalParameters, parameters_of
from datasets.render import Camera, Frames, Palette, render
from datasets.shapes import ShapeFamily, Shapes
from expert.errors import InvalidProblem, SolverFailed
from expert.problems.contact import ContactTask, Plan
from expert.world.values import require

ATTEMPTS = 100
"""Draws of a shape and a motion before a task is given up."""


@dataclass(frozen=True, kw_only=True)
class Specification:
    """name: one word; it takes part in seeding, so that data sets of one seed share no task.

    count: tasks.  shard: tasks per file, the unit of work that a killed job loses at most.
    """

    name: str
    count: Annotated[int, Number(whole=True, least=1, most=10**7)]
    shard: Annotated[int, Number(whole=True, least=1, most=10**4)] = 4
    shapes: ShapeFamily = field(default_factory=Shapes)
    tasks: TaskSettings = field(default_factory=TaskSettings)
    camera: Camera = field(default_factory=Camera)
    palette: Palette = field(default_factory=Palette)
    labelling: Labelling = field(default_factory=Labelling)

    def __post_init__(self) -> None:
        require(
            isinstance(self.name, str) and self.name.isidentifier(), "dataset.name", "one word", self.name
        )
        check_numbers(self, "dataset.")

    @property
    def shards(self) -> int:
        """Number of files."""
        return -(-self.count // self.shard)

    def indices(self, shard: int) -> range:
        """Tasks of a shard."""
        return range(shard * self.shard, min((shard + 1) * self.shard, self.count))

    def settings(self) -> dict[str, object]:
        """All that the data depends on besides the seed and the versions of the code, as plain values."""
        return dataclasses.asdict(self)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One labelled task: video (T, size, size, 3) uint8 RGB, the task, the expert's plan, and P(t)."""

    index: int
    attempt: int
    family: str
    video: Frames
    task: ContactTask
    plan: Plan
    parameters: MechanicalParameters


@dataclass(frozen=True, kw_only=True)
class FailedDraw:
    """A draw that gave no sample; see Refusal for the reasons."""

    index: int
    attempt: int
    family: str
    reason: str
    detail: str


def draw(specification: Specification, seed: int, index: int) -> tuple[Sample, list[FailedDraw]]:
    """Sample `index` of the data set and the draws that failed before it.

    Raises SolverFailed where ATTEMPTS draws gave none.
    """
    family = list(FAMILIES)[index % len(FAMILIES)]
    failed: list[FailedDraw] = []
    for attempt in range(ATTEMPTS):
        answer = _attempt(specification, generator(specification.name, seed, index, attempt), family)
        if isinstance(answer, Refusal):
            failed.append(FailedDraw(index=index, attempt=attempt, family=family, **vars(answer)))
        else:
            task, plan, parameters = answer
            poses = task.trajectory.poses
            video = render(task.body.vertices, poses, specification.camera, specification.palette)
            sample = Sample(
                index=index,
                attempt=attempt,
                family=family,
                video=video,
                task=task,
                plan=plan,
                parameters=parameters,
            )
            return sample, failed
    last = failed[-1]
    raise SolverFailed(
        f"task {index} ({family}): no label in {ATTEMPTS} draws; the last: {last.reason}, {last.detail}"
    )


def generator(name: str, seed: int, index: int, attempt: int) -> np.random.Generator:
    """Independent of the order in which tasks are drawn."""
    return np.random.default_rng([seed, zlib.crc32(name.encode()), index, attempt])


def _attempt(
    specification: Specification, rng: np.random.Generator, family: str
) -> tuple[ContactTask, Plan, MechanicalParameters] | Refusal:
    try:
        task = sample_task(rng, family, specification.shapes, specification.tasks)
    except NoRoom as unsuitable:
        return Refusal(reason="no_motion", detail=str(unsuitable))
    answer = label(task, specification.labelling)
    if isinstance(answer, Refusal):
        return answer
    try:
        return answer.task, answer.plan, parameters_of(answer.task, answer.plan)
    except InvalidProblem as inexpressible:
        return Refusal(reason="inexpressible", detail=str(inexpressible))
