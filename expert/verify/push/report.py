"""What the checker of pushes answers: every law by name, and where each push really ends."""

from dataclasses import dataclass
from typing import Any, Literal

from expert.verify.plan.report import Check
from expert.verify.report import Report


@dataclass(frozen=True, kw_only=True)
class PushReport(Report):
    """Sound, refuted by the checks that are not ok, or unknown.

    ends: poses (3,) of the object after each push, by the checker's own integration.  uncertain: how far they may be off [m].
    sliding: share of the way in contact on which the contact slides.
    """

    certificate = "push"

    verdict: Literal["sound", "refuted", "unknown"]
    checks: tuple[Check, ...] = ()
    ends: tuple[tuple[float, ...], ...] = ()
    uncertain: float = 0.0
    sliding: float = 0.0

    @property
    def violations(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if not check.ok)

    def evidence(self) -> dict[str, Any]:
        """Every law, and the object's poses."""
        return {
            "checks": [check.as_dict() for check in self.checks],
            "ends": [list(end) for end in self.ends],
            "uncertain": self.uncertain,
            "sliding": self.sliding,
        }

    def lines(self) -> list[str]:
        """The verdict, then every law."""
        contact = f"the contact slides on {self.sliding:.0%} of its way" if self.ends else ""
        return [
            f"{self.verdict}: {self.claim}" + (f" ({self.reason})" if self.reason else ""),
            *map(str, self.checks),
            *([contact] if contact else []),
        ]
