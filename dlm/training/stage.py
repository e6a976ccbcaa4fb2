"""What one stage of training is (Thesis 4.3): its policy, loss and data, and the schedule of its steps."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import cos, pi
from typing import Annotated, Any, Literal

from datasets.limits import Number, check_numbers
from dlm.policy import Loss, PolicyKind
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """iterations: passes over the tasks.  log_every, save_every: iterations between curve points and between checkpoints.

    decay: constant, or cosine, half a wave from learning_rate at the first step to 0 after the last one.
    """

    iterations: Annotated[int, Number(whole=True, least=1)] = 100
    batch_size: Annotated[int, Number(unit="tasks", whole=True, least=2)] = 5
    learning_rate: Annotated[float, Number(above=0, most=1)] = 1e-4
    log_every: Annotated[int, Number(whole=True, least=1)] = 5
    save_every: Annotated[int, Number(whole=True, least=1)] = 5
    seed: Annotated[int, Number(whole=True, least=0, most=2**63 - 1)] = 0
    decay: Literal["constant", "cosine"] = "constant"

    def __post_init__(self) -> None:
        check_numbers(self)
        require(self.decay in ("constant", "cosine"), "schedule.decay", "constant or cosine", self.decay)

    def rate(self, share: float) -> float:
        """Learning rate when this share of all steps is done."""
        return self.learning_rate * (0.5 + 0.5 * cos(pi * share) if self.decay == "cosine" else 1.0)


@dataclass(frozen=True, kw_only=True)
class Stage:
    """What one stage learns by: policy, loss, data set, and the stage whose weights it starts from.

    schedule: what differs from the common schedule, by the names of `Schedule`.
    """

    name: str
    policy: PolicyKind
    loss: Loss
    dataset: str
    warm_start: str | None = None
    schedule: Mapping[str, float | str] = field(default_factory=dict)

    def scheduled(self, common: Schedule) -> Schedule:
        """The common schedule with what this stage does otherwise.  Raises InvalidProblem for senseless values."""
        own: dict[str, Any] = {**asdict(common), **self.schedule}
        return Schedule(**own)
