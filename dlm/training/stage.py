"""What one stage of training is (Thesis 4.3): its policy, loss and data, and the schedule of its steps."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

from datasets.limits import Number, check_numbers
from dlm.policy import Loss, PolicyKind


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """iterations: passes over the tasks.  log_every, save_every: iterations between curve points and between checkpoints."""

    iterations: Annotated[int, Number(whole=True, least=1)] = 100
    batch_size: Annotated[int, Number(unit="tasks", whole=True, least=2)] = 5
    learning_rate: Annotated[float, Number(above=0, most=1)] = 1e-4
    log_every: Annotated[int, Number(whole=True, least=1)] = 5
    save_every: Annotated[int, Number(whole=True, least=1)] = 5
    seed: Annotated[int, Number(whole=True, least=0, most=2**63 - 1)] = 0

    def __post_init__(self) -> None:
        check_numbers(self)


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
    schedule: Mapping[str, float] = field(default_factory=dict)

    def scheduled(self, common: Schedule) -> Schedule:
        """The common schedule with what this stage does otherwise.  Raises InvalidProblem for senseless values."""
        own: dict[str, Any] = {**asdict(common), **self.schedule}
        return Schedule(**own)
