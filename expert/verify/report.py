"""What every checker answers: one header, then the evidence of its kind."""

from dataclasses import dataclass
from typing import Any, ClassVar

SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class Report:
    """Verdict on an answer.

    verdict: sound, caged, certified, refuted, escapes or unknown.  claim: what the answer states.  reason: why the verdict is
    what it is, where the evidence does not say so.  claimed: fields of the answer that nothing here depends on: they are
    claimed, not checked.  seconds: processor time.
    """

    certificate: ClassVar[str]
    """Kind of problem."""

    verdict: str
    claim: str = ""
    reason: str = ""
    claimed: tuple[str, ...] = ()
    seconds: float = 0.0

    def evidence(self) -> dict[str, Any]:
        """What was computed, as plain JSON values."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: the certificate file."""
        return {
            "schema": SCHEMA,
            "certificate": self.certificate,
            "verdict": self.verdict,
            "claim": self.claim,
            "reason": self.reason,
            "claimed": list(self.claimed),
            "seconds": self.seconds,
            **self.evidence(),
        }

    def lines(self) -> list[str]:
        """For a reader: the verdict, then the evidence."""
        raise NotImplementedError

    def __str__(self) -> str:
        unchecked = [f"claimed, not checked: {', '.join(self.claimed)}"] if self.claimed else []
        return "\n".join([*self.lines(), *unchecked])
