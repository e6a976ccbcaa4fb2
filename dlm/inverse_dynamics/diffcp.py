"""DIFFCP with Clarabel inside, item by item, so that one bad program cannot spoil its batch."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import diffcp
import numpy as np
import scipy.sparse as sp
import torch
from cvxpy.reductions.solvers.conic_solvers.scs_conif import dims_to_solver_dict
from cvxpylayers.interfaces.base import SolverInterface
from torch import Tensor

from expert.geometry.pose import Array

TOLERANCES = ((1e-10, 1e-8), (1e-8, 1e-6))
"""What Clarabel is asked for and what is accepted, at the first and the second try.

A quadratic cost becomes a cone, |z|^2 <= t, and an error in t is a square of that in z: hence the small numbers."""

Adjoint = Callable[..., tuple[sp.csc_matrix, Array, Array]]
Solution = tuple[Array, Array, Adjoint | None]


class DiffcpClarabel(SolverInterface):
    """Canonical cone programs to primal and dual solutions; rows of nan mark the programs without one.

    Derivatives by DIFFCP's dense factorisation: its iterative one stops far from the answer on these programs.
    """

    canon_solver = "DIFFCP"

    def setup(self, ctx: Any) -> None:
        """Sparsity pattern of [A | b], the same for all items, and the cones."""
        indices, pointers, shape = ctx.reduced_A.problem_data_index
        self.pattern = (indices, pointers)
        self.shape = (int(shape[0]), int(shape[1]))
        self.offset_rows = indices[pointers[-2] : pointers[-1]]
        self.cones = dims_to_solver_dict(ctx.cone_dims)

    def solve_torch_batch(
        self, P: Tensor | None, q: Tensor, A: Tensor, dims: Any, solver_args: dict[str, Any], needs_grad: bool
    ) -> tuple[Tensor, Tensor, list[Adjoint | None]]:
        """Primal (b, n), dual (b, m) and the adjoints of the solution maps."""
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            solve = partial(
                self._solve, mode="dense" if needs_grad else "lsqr"
            )  # the latter prepares nothing
            solved = list(pool.map(solve, A.detach().numpy(), q.detach().numpy()[:, :-1]))
        primal, dual, adjoints = zip(*solved, strict=True)
        return torch.from_numpy(np.stack(primal)), torch.from_numpy(np.stack(dual)), list(adjoints)

    def derivative_torch_batch(
        self, dprimal: Tensor, ddual: Tensor, saved_state: list[Adjoint | None]
    ) -> tuple[None, Tensor, Tensor]:
        """Gradients with respect to q (b, n + 1) and the entries of [A | b]."""
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            rows = list(pool.map(self._pull_back, saved_state, dprimal.numpy(), ddual.numpy()))
        costs, entries = (torch.from_numpy(np.stack([r[i] for r in rows])) for i in (0, 1))
        return None, costs, entries

    def _solve(self, entries: Array, cost: Array, mode: str) -> Solution:
        nothing = np.full(self.shape[1] - 1, np.nan), np.full(self.shape[0], np.nan), None
        if not (np.isfinite(entries).all() and np.isfinite(cost).all()):
            return nothing
        tries = (self._try(entries, cost, mode, *tolerances) for tolerances in TOLERANCES)
        return next((solution for solution in tries if solution is not None), nothing)

    def _try(self, entries: Array, cost: Array, mode: str, asked: float, accepted: float) -> Solution | None:
        table = sp.csc_matrix((entries.copy(), *self.pattern), shape=self.shape)
        result = diffcp.solve_and_derivative_internal(
            -table[:, :-1],
            table[:, -1].toarray().ravel(),
            cost.copy(),
            self.cones,
            solve_method="Clarabel",
            mode=mode,
            **{f"tol_{name}": asked for name in ("gap_abs", "gap_rel", "feas")},
            **{f"reduced_tol_{name}": accepted for name in ("gap_abs", "gap_rel", "feas")},
        )
        solved = (
            result["info"]["status"] in ("Solved", "Optimal Inaccurate") and np.isfinite(result["x"]).all()
        )
        return (result["x"], result["y"], result["DT"]) if solved else None

    def _pull_back(self, adjoint: Adjoint | None, dx: Array, dy: Array) -> tuple[Array, Array]:
        size = np.sqrt(dx @ dx + dy @ dy)
        if adjoint is None or not size > 0:
            return np.zeros(self.shape[1]), np.zeros(len(self.pattern[0]))
        # DIFFCP takes gradients below 1e-8 for zero: hand it one of unit length.
        dA, db, dc = adjoint(dx / size, dy / size, np.zeros(self.shape[0]))
        entries = np.concatenate([-dA.data, db[self.offset_rows]])
        return size * np.append(dc, 0.0), size * entries
