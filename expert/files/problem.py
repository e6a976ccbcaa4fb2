"""What a problem file and a solution file hold once they are read."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A problem file: its kind, the whole file, the task in it and keyword options for its solver."""

    kind: str
    data: dict[str, Any]
    task: Any
    options: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A solution file: the problem that it repeats and the answer to it."""

    problem: Problem
    answer: Any
