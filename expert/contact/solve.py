"""One entry for all methods of contact-trajectory optimization."""

from typing import get_args

from expert.errors import InvalidProblem
from expert.problems.contact import ContactMethod, ContactOptions, ContactTask, Plan


def solve(
    task: ContactTask,
    *,
    method: ContactMethod = ContactOptions.method,
    gap: float = ContactOptions.gap,
    time_limit: float = ContactOptions.time_limit,
    node_limit: int | None = ContactOptions.node_limit,
    polish: bool = True,
) -> Plan:
    """Where and with what forces do fingers make this motion (Thesis 3.1)?  Positions [m], forces [N], or a proof.

    method: exact (branch and bound, no envelope error), thesis (MIQP1), scip (the exact bilinear model).  time_limit [s] is
    processor time.  node_limit and polish concern the exact method alone.  Raises InvalidProblem for an unknown method,
    SolverFailed where numerical failures leave the task undecided.
    """
    # Imported when asked for: the mixed-integer models load cvxpy and SCIP.
    if method == "exact":
        from expert.contact import exact

        return exact.solve(task, gap=gap, time_limit=time_limit, node_limit=node_limit, polish=polish)
    if method == "thesis":
        from expert.contact import thesis

        return thesis.solve(task, gap=gap, time_limit=time_limit)
    if method == "scip":
        from expert.contact import bilinear

        return bilinear.solve(task, gap=gap, time_limit=time_limit)
    raise InvalidProblem("method", expected=f"one of {', '.join(get_args(ContactMethod))}", got=method)
