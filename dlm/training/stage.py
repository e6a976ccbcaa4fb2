"""What one stage of training is (Thesis 4.3): its policy, loss and data, and the schedule of its steps."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from dlm.policy import Loss, PolicyKind
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """iterations: passes over the tasks.  log_every, save_every: iterations between curve points and between checkpoints."""

    iterations: int = 100
    batch_size: int = 5
    learning_rate: float = 1e-4
    log_every: int = 5
    save_every: int = 5
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("iterations", "log_every", "save_every"):
            value = getattr(self, name)
            require(isinstance(value, int) and value >= 1, name, "a whole number >= 1", value)
        require(self.batch_size >= 2, "batch_size", "at least 2, for batch norm", self.batch_size)
        require(0 < self.learning_rate < 1, "learning_rate", "a number in (0, 1)", self.learning_rate)


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
