"""What a checker of plans answers: every law by name, with its largest violation and where it occurs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from expert.verify.report import Report


@dataclass(frozen=True, kw_only=True)
class Check:
    """One law: its largest violation, in the stated unit, against what is tolerated; `where` it is largest."""

    name: str
    value: float
    limit: float
    unit: str
    where: str = ""

    @property
    def ok(self) -> bool:
        """Whether the law holds; a violation that is not a number does not."""
        return self.value <= self.limit

    @classmethod
    def largest(cls, name: str, violations: object, limit: float, unit: str, axes: Sequence[str]) -> "Check":
        """The worst entry of an array of violations whose axes count steps, fingers, ...; none: holds."""
        array = np.nan_to_num(np.asarray(violations, dtype=float), nan=np.inf)
        if not array.size or array.max() <= 0:
            return cls(name=name, value=0.0, limit=limit, unit=unit)
        index = np.unravel_index(int(array.argmax()), array.shape)
        where = ", ".join(f"{axis} {i}" for axis, i in zip(axes, index, strict=True))
        return cls(name=name, value=float(array[index]), limit=limit, unit=unit, where=where)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values; an infinite violation is null."""
        value = self.value if np.isfinite(self.value) else None
        return {
            "check": self.name,
            "ok": self.ok,
            "violation": value,
            "limit": self.limit,
            "unit": self.unit,
            "where": self.where,
        }

    def __str__(self) -> str:
        place = f" at {self.where}" if self.where else ""
        mark = "ok     " if self.ok else "REFUTED"
        return f"{mark} {self.name:22s} {self.value:9.2e} (limit {self.limit:.0e}, in {self.unit}){place}"


@dataclass(frozen=True, kw_only=True)
class PlanReport(Report):
    """Sound, refuted by the checks that are not ok, or unknown."""

    certificate = "contact_trajectory"

    verdict: Literal["sound", "refuted", "unknown"]
    checks: tuple[Check, ...] = ()

    @property
    def violations(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if not check.ok)

    def check(self, name: str) -> Check:
        """The check of that name.  Raises KeyError."""
        return {check.name: check for check in self.checks}[name]

    def evidence(self) -> dict[str, Any]:
        """Every law."""
        return {"checks": [check.as_dict() for check in self.checks]}

    def lines(self) -> list[str]:
        """The verdict, then every law."""
        return [
            f"{self.verdict}: {self.claim}" + (f" ({self.reason})" if self.reason else ""),
            *map(str, self.checks),
        ]
