"""One entry for all methods of contact-trajectory optimization."""

from importlib import import_module

from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask, Plan

METHODS = {
    "exact": "expert.contact.exact",
    "thesis": "expert.contact.thesis",
    "scip": "expert.contact.bilinear",
}


def solve(
    task: ContactTask,
    *,
    method: str = "exact",
    gap: float = 1e-3,
    time_limit: float = 60.0,
    node_limit: int | None = None,
    polish: bool = True,
) -> Plan:
    """Where and with what forces do fingers make this motion (Thesis 3.1)?  Positions [m], forces [N], or a proof.

    method: exact (branch and bound, no envelope error), thesis (MIQP1), scip (the exact bilinear model).  node_limit
    and polish concern the exact method alone.  Raises InvalidProblem for an unknown method, SolverFailed where
    numerical failures leave the task undecided.
    """
    if method not in METHODS:
        raise InvalidProblem("method", expected=f"one of {', '.join(METHODS)}", got=method)
    run = import_module(
        METHODS[method]
    ).solve  # the mixed-integer models load cvxpy and SCIP: only when asked for
    if method == "exact":
        return run(task, gap=gap, time_limit=time_limit, node_limit=node_limit, polish=polish)
    return run(task, gap=gap, time_limit=time_limit)
