"""What `time_limit` means: processor time of the work, counted the same way by every stage of every kind."""

import time
from math import inf


class Budget:
    """Processor time [s] that may be spent from now on; infinite: no limit.

    The time of the process, on all of its threads, user and system.  Not wall time: what is found must not depend on the
    machine's load.  Not the time of one thread: a library that works on threads of its own would escape the limit, and a
    callback from one of them would read another clock.  Searches that run at the same time need a process each, or each
    counts the other's work as its own.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = float(seconds)
        self._began = time.process_time()

    @property
    def spent(self) -> float:
        """Since the beginning [s]."""
        return time.process_time() - self._began

    @property
    def left(self) -> float:
        """Never negative [s]."""
        return max(self.seconds - self.spent, 0.0)

    @property
    def over(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0

    def part(self, seconds: float) -> "Budget":
        """A budget of its own for a stage, from now on: so many seconds, but never more than what is left here."""
        return Budget(min(seconds, self.left))


UNLIMITED = Budget(inf)
"""For work without a limit."""
