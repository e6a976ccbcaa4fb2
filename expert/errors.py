"""What can go wrong, by cause, so that a numerical failure is never mistaken for a proof."""


class ExpertError(Exception):
    """Base of all errors that this package raises on purpose."""


class InvalidProblem(ExpertError):
    """The input cannot be accepted.  One line: the field, what was expected, what came, how to mend it."""

    def __init__(self, field: str, *, expected: str, got: str, remedy: str = "") -> None:
        self.field, self.expected, self.got, self.remedy = field, expected, got, remedy
        line = f"{field}: expected {expected}, got {got}" + (f"; {remedy}" if remedy else "")
        super().__init__(" ".join(line.split()))

    def __reduce__(self) -> tuple:
        return _rebuild, (type(self), self.field, self.expected, self.got, self.remedy)


def _rebuild(cls: type, field: str, expected: str, got: str, remedy: str) -> InvalidProblem:
    return cls(field, expected=expected, got=got, remedy=remedy)


class OutOfTime(ExpertError):
    """A budget was spent before there was an answer.  Says nothing about what the answer would be."""


class SolverFailed(ExpertError):
    """A numerical method gave no answer.  Says nothing about feasibility."""
