"""Fast backend: sparse interior-point solutions (PIQP), differentiated through their KKT conditions."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
import piqp
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import torch
from cvxpylayers.interfaces.base import SolverInterface
from torch import Tensor

from expert.geometry.pose import Array

TOLERANCE = 1e-9
REGULARISATION = 1e-8
REFINEMENTS = 3
STIFFEST = 1e10
"""Bounds on slack over multiplier: what lies beyond is as good as inactive (or active)."""


@dataclass(frozen=True)
class Optimum:
    """Of min x' P x / 2 + q' x, A x + s = b, s = 0 in equalities and >= 0 elsewhere: x, multipliers y, slacks s, entries of A."""

    x: Array
    y: Array
    s: Array
    A: sp.csc_matrix


class InteriorPointKKT(SolverInterface):
    """Canonical quadratic programs to primal and dual solutions; rows of nan mark the programs without one."""

    canon_solver = "CLARABEL"
    supports_quad_obj = True

    def setup(self, ctx: Any) -> None:
        """Sparsity patterns of P, of [A | b] and of the KKT matrix, the same for all items."""
        self.cost_pattern = ctx.reduced_P.problem_data_index
        self.table_pattern = ctx.reduced_A.problem_data_index
        self.equalities = int(ctx.cone_dims.zero)
        self.rows, self.unknowns = int(self.table_pattern[2][0]), int(self.table_pattern[2][1]) - 1
        indices, pointers, _ = self.table_pattern
        self.offset_rows = indices[pointers[-2] :]
        self.A_rows = indices[: pointers[-2]]
        self.A_columns = np.repeat(np.arange(self.unknowns), np.diff(pointers[:-1]))

    def solve_torch_batch(
        self, P: Tensor, q: Tensor, A: Tensor, dims: Any, solver_args: dict[str, Any], needs_grad: bool
    ) -> tuple[Tensor, Tensor, tuple[list[sp.csc_matrix], list[Optimum | None]]]:
        """Primal (b, n), dual (b, m), and what the derivative needs."""
        costs = [self._matrix(p, self.cost_pattern) for p in P.detach().numpy()]
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            optima = list(pool.map(self._solve, costs, q.detach().numpy()[:, :-1], A.detach().numpy()))
        none = Optimum(np.full(self.unknowns, np.nan), np.full(self.rows, np.nan), np.empty(0), None)
        primal = torch.from_numpy(np.stack([(o or none).x for o in optima]))
        dual = torch.from_numpy(np.stack([(o or none).y for o in optima]))
        return primal, dual, (costs, optima)

    def derivative_torch_batch(
        self, dprimal: Tensor, ddual: Tensor, saved_state: tuple[list[sp.csc_matrix], list[Optimum | None]]
    ) -> tuple[None, Tensor, Tensor]:
        """Gradients with respect to q (b, n + 1) and the entries of [A | b]; P is a constant of the program."""
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            pulled = list(pool.map(self._pull_back, *saved_state, dprimal.numpy(), ddual.numpy()))
        costs, entries = (torch.from_numpy(np.stack([p[i] for p in pulled])) for i in (0, 1))
        return None, costs, entries

    def _matrix(self, entries: Array, pattern: tuple) -> sp.csc_matrix:
        return sp.csc_matrix((entries, *pattern[:2]), shape=pattern[2])

    def _solve(self, P: sp.csc_matrix, q: Array, entries: Array) -> Optimum | None:
        if not (np.isfinite(entries).all() and np.isfinite(q).all()):
            return None
        table = self._matrix(entries, self.table_pattern)
        A, b = -table[:, :-1], table[:, -1].toarray().ravel()
        return self._by_piqp(P, q, A, b) or self._by_clarabel(P, q, A, b)

    def _by_piqp(self, P: sp.csc_matrix, q: Array, A: sp.csc_matrix, b: Array) -> Optimum | None:
        solver, e = piqp.SparseSolver(), self.equalities
        solver.settings.eps_abs = solver.settings.eps_rel = TOLERANCE
        rows = A.tocsr()
        solver.setup(P, q, rows[:e].tocsc(), b[:e], rows[e:].tocsc(), None, b[e:])
        if solver.solve() != piqp.PIQP_SOLVED:
            return None
        found = solver.result
        y, s = np.concatenate([found.y, found.z_u]), np.concatenate([np.zeros(e), found.s_u])
        return Optimum(np.array(found.x), y, s, A)

    def _by_clarabel(self, P: sp.csc_matrix, q: Array, A: sp.csc_matrix, b: Array) -> Optimum | None:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        cones = [clarabel.ZeroConeT(self.equalities), clarabel.NonnegativeConeT(self.rows - self.equalities)]
        found = clarabel.DefaultSolver(sp.triu(P).tocsc(), q, A, b, cones, settings).solve()
        if found.status != clarabel.SolverStatus.Solved:
            return None
        return Optimum(np.array(found.x), np.array(found.z), np.array(found.s), A)

    def _pull_back(
        self, P: sp.csc_matrix, optimum: Optimum | None, dx: Array, dy: Array
    ) -> tuple[Array, Array]:
        """Adjoint of P dx + A' dy = -(dq + dA' y), A dx - (s / y) dy = db - dA x (4-CT6 at its optimum)."""
        if optimum is None or not (dx.any() or dy.any()):
            return np.zeros(self.unknowns + 1), np.zeros(len(self.table_pattern[0]))
        u, v = np.split(self._solve_kkt(P, optimum, np.concatenate([dx, dy])), [self.unknowns])
        toward_A = optimum.y[self.A_rows] * u[self.A_columns] + v[self.A_rows] * optimum.x[self.A_columns]
        return np.append(-u, 0.0), np.concatenate([toward_A, v[self.offset_rows]])

    def _solve_kkt(self, P: sp.csc_matrix, optimum: Optimum, rhs: Array) -> Array:
        """K u = rhs by a quasi-definite factorisation, then refined."""
        e, A = self.equalities, optimum.A
        flexibility = np.zeros(self.rows)
        flexibility[e:] = np.clip(optimum.s[e:] / np.maximum(optimum.y[e:], 1e-300), 0, STIFFEST)
        K = sp.bmat([[P, A.T], [A, -sp.diags(flexibility)]], format="csc")
        shift = REGULARISATION * np.concatenate([np.ones(self.unknowns), -np.ones(self.rows)])
        factor = spl.splu(
            (K + sp.diags(shift)).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        u = factor.solve(rhs)
        for _ in range(REFINEMENTS):
            u = u + factor.solve(rhs - K @ u)
        return u
