"""What this package can solve, check and draw: one class per problem kind; `expert.files` reads and writes their files.

Imports stand inside the functions, so that a checker never loads a solver, and none of both a picture.
"""

import os
from typing import Any

from expert.errors import InvalidProblem
from expert.verify.report import Report


class Kind:
    """solved: statuses that count as success.

    solve(task, **options) -> answer with a `status`; the options are those of the kind's dataclass (`FORMATS[kind].OPTIONS`).
    verify(task, answer) -> Report; answer is None for a problem file that states what there is to check.
    draw(task, answer, path): picture or animation by the suffix of path; answer likewise.  view: one part of the picture.
    """

    solved: tuple[str, ...]

    def solve(self, task: Any, **options: Any) -> Any:
        raise NotImplementedError

    def verify(self, task: Any, answer: Any) -> Report:
        raise NotImplementedError

    def draw(self, task: Any, answer: Any, path: str | os.PathLike[str], view: str | None = None) -> None:
        raise NotImplementedError


class ContactTrajectory(Kind):
    """Thesis 3.1: where and with what forces do fingers make a motion?"""

    solved = ("optimal",)

    def solve(self, task: Any, **options: Any) -> Any:
        from expert.contact.solve import solve

        return solve(task, **options)

    def verify(self, task: Any, answer: Any) -> Report:
        from expert.verify.plan.check import verify

        return verify(task, answer)

    def draw(self, task: Any, answer: Any, path: str | os.PathLike[str], view: str | None = None) -> None:
        from expert.drawing.contact_trajectory import draw

        _require_no(view)
        draw(task, answer, path)


class Cage(Kind):
    """Thesis 5.1: where do fingers stand so that an object cannot escape?"""

    solved = ("caged",)

    def solve(self, task: Any, **options: Any) -> Any:
        from expert.caging.synthesis import solve

        return solve(task, **options)

    def verify(self, task: Any, answer: Any) -> Report:
        from expert.verify.cage.check import verify

        return verify(task, answer)

    def draw(self, task: Any, answer: Any, path: str | os.PathLike[str], view: str | None = None) -> None:
        from expert.drawing.cage import draw

        draw(task, answer, path, view or "all")


class CertifiedGrasp(Kind):
    """Thesis 5.2: which finger paths push an object from anywhere nearby into one grasp?"""

    solved = ("certified",)

    def solve(self, task: Any, **options: Any) -> Any:
        from expert.grasping.synthesis import solve

        return solve(task, **options)

    def verify(self, task: Any, answer: Any) -> Report:
        from expert.verify.grasp.check import verify

        return verify(task, answer)

    def draw(self, task: Any, answer: Any, path: str | os.PathLike[str], view: str | None = None) -> None:
        from expert.drawing.certified_grasp import draw

        _require_no(view)
        draw(task, answer, path)


class PushToGoal(Kind):
    """Which straight pushes of one finger bring an object on a table to its goal?"""

    solved = ("solved",)

    def solve(self, task: Any, **options: Any) -> Any:
        from expert.pushing.synthesis import solve

        return solve(task, **options)

    def verify(self, task: Any, answer: Any) -> Report:
        from expert.verify.push.check import verify

        return verify(task, answer)

    def draw(self, task: Any, answer: Any, path: str | os.PathLike[str], view: str | None = None) -> None:
        from expert.drawing.push import draw

        _require_no(view)
        draw(task, answer, path)


def _require_no(view: str | None) -> None:
    if view:
        raise InvalidProblem("view", expected="none for this kind", got=view)


KINDS: dict[str, Kind] = {
    "contact_trajectory": ContactTrajectory(),
    "cage": Cage(),
    "certified_grasp": CertifiedGrasp(),
    "push": PushToGoal(),
}
