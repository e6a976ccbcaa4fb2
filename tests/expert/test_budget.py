"""A budget counts the processor time of the whole process, and nothing else."""

import threading
import time

import numpy as np
import pytest

from expert.budget import Budget


def work(seconds: float) -> None:
    """Keep one thread busy for so much of its own processor time [s]."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        sum(range(1000))


def test_work_is_counted_and_sleep_is_not():
    budget = Budget(1.0)
    time.sleep(0.2)
    assert budget.spent < 0.1
    work(0.2)
    assert 0.2 <= budget.spent < 0.4
    assert budget.left == pytest.approx(1.0 - budget.spent, abs=0.01)
    assert not budget.over


def test_work_on_other_threads_is_counted():
    budget = Budget(1.0)
    other = threading.Thread(target=work, args=(0.2,))
    other.start()
    other.join()
    assert budget.spent >= 0.2


def test_a_part_never_outlasts_the_whole():
    budget = Budget(0.1)
    assert budget.part(5.0).seconds <= 0.1
    assert budget.part(0.02).seconds == 0.02
    work(0.1)
    assert budget.over
    assert budget.left == 0
    assert budget.part(5.0).over


def test_without_a_limit_it_is_never_over():
    budget = Budget(np.inf)
    assert budget.left == np.inf
    assert not budget.over
    assert budget.part(2.0).seconds == 2.0
