"""What a search for a cage keeps: the best verified answer, its counts, and what is left of its time."""

from dataclasses import dataclass, field, replace

from expert.budget import Budget
from expert.caging.requirements import objective
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.problems.cage import CageProblem, CageSolution, Meeting
from expert.verify.cage.check import verify_cage
from expert.verify.cage.claims import unmet_claim
from expert.verify.cage.report import CageReport


@dataclass
class Tally:
    """What happened so far, and the best verified answer."""

    problem: CageProblem
    budget: Budget
    attempts: int = 0
    refuted: int = 0
    unconfirmed: int = 0
    exhausted: dict[tuple[object, ...], bool] = field(default_factory=dict)
    """Whether each model tried is proved to have no (more) solutions.  A better answer to beat does not give it any."""
    best: CageSolution = field(default_factory=lambda: CageSolution(status="none_found"))

    @property
    def done(self) -> bool:
        """Whether a better answer cannot be found: there is one, and no cost."""
        return self.best.found and self.problem.cost == "none"

    def judge(self, fingers: Array) -> CageReport | None:
        """Verify a model's fingers (count, 2) [m] and count.  None where they do not even fit beside the object."""
        try:
            report = verify_cage(self.problem.arrangement(fingers), time_limit=self.budget.left)
        except InvalidProblem:
            self.refuted += 1
            return None
        self.refuted += report.verdict == "escapes"
        self.unconfirmed += report.verdict == "unknown"
        return report

    def keep(self, fingers: Array, report: CageReport, topology: tuple[Meeting, ...] = ()) -> None:
        """Remember a verified cage if it is the best so far and keeps what else was asked for."""
        found = CageSolution(
            status="caged",
            fingers=fingers,
            rotation_range=report.rotation_range,
            topology=topology,
            objective=objective(self.problem, fingers),
        )
        if unmet_claim(self.problem, found):
            self.refuted += 1
        elif not self.best.found or found.objective < self.best.objective:
            self.best = found

    def answer(self) -> CageSolution:
        """The best verified cage, or why there is none."""
        best = self.best
        if not best.found:
            stopped = self.budget.over or not all(self.exhausted.values())
            reason = (
                "the time limit was reached before any cage was verified"
                if stopped
                else "no cage of the kind searched for within the rotation ranges tried; others may exist"
            )
            best = CageSolution(status="time_limit" if stopped else "none_found", reason=reason)
        return replace(
            best,
            seconds=self.budget.spent,
            attempts=self.attempts,
            refuted=self.refuted,
            unconfirmed=self.unconfirmed,
        )
