"""Why a task is infeasible, and the least change that would mend it."""

import numpy as np

from expert.contact.modes import step_costs
from expert.contact.scaled import ScaledTask
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask

LARGEST_FRICTION = 2.0
"""No more finger friction than this is suggested."""


def why_infeasible(task: ContactTask, scaled: ScaledTask, phi: Array) -> str:
    """The first step without force balance and what would give it one; or that no sequence of contacts fits together."""
    blocked = np.flatnonzero(~np.isfinite(phi).any(axis=1))
    if not len(blocked):
        return "no consistent contact sequence: every step can be balanced by itself, but not by contacts that persist"
    count = task.fingers.count
    fingers = f"{count} finger{'s' * (count > 1)} with friction {task.fingers.friction:g}"
    mending = [*_more_friction(scaled, count), *_more_fingers(scaled, count)]
    remedy = f"; {' or '.join(mending)} would give every step a force balance" if mending else ""
    return f"step {blocked[0]} admits no force balance with {fingers}{remedy}"


def _balanced(scaled: ScaledTask, fingers: int) -> bool:
    return bool(np.isfinite(step_costs(scaled, fingers).cost).any(axis=1).all())


def _more_fingers(scaled: ScaledTask, count: int) -> list[str]:
    return [f"{count + 1} fingers"] if count < 3 and _balanced(scaled, count + 1) else []


def _more_friction(scaled: ScaledTask, count: int) -> list[str]:
    """Bisection on finger friction, to a part in a thousand, rounded up."""
    share = scaled.friction / scaled.true_friction

    def enough(mu: float) -> bool:
        return _balanced(scaled._replace(friction=share * mu, true_friction=mu), count)

    low, high = scaled.true_friction, LARGEST_FRICTION
    if low >= high or not enough(high):
        return []
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return [f"finger friction {np.ceil(high * 1e3) / 1e3:g}"]
