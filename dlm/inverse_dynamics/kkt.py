"""Fast backend: sparse interior-point solutions (PIQP), differentiated through their KKT conditions."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, cast

import clarabel
import numpy as np
import piqp
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import torch
from cvxpylayers.interfaces.base import SolverInterface
from torch import Tensor

from expert.geometry.pose import Array
from expert.world.values import IntArray

TOLERANCE = 1e-9
REGULARISATION = 1e-8
REFINEMENTS = 3
STIFFEST = 1e10
"""Bound on slack over multiplier: beyond it a constraint is as good as inactive."""


class Pattern:
    """Where the entries of a sparse matrix go; entries at the same place add up."""

    def __init__(self, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> None:
        places, self.slots = np.unique(columns * shape[0] + rows, return_inverse=True)
        self.indices = (places % shape[0]).astype(np.int32)
        self.pointers = np.searchsorted(places, np.arange(shape[1] + 1) * shape[0]).astype(np.int32)
        self.shape = shape

    def matrix(self, entries: Array) -> sp.csc_matrix:
        """The matrix with these entries, in the order of the constructor's rows and columns."""
        data = np.bincount(self.slots, weights=entries, minlength=len(self.indices))
        return sp.csc_matrix((data, self.indices, self.pointers), shape=self.shape)


@dataclass(frozen=True)
class Optimum:
    """Solution of one program: x, multipliers y, slacks s >= 0 (equalities: 0), and the entries of P and A."""

    x: Array
    y: Array
    s: Array
    P: Array
    A: Array


class InteriorPointKKT(SolverInterface):
    """min x' P x / 2 + q' x, A x + s = b, to primal and dual solutions; rows of nan mark the programs without one."""

    canon_solver = "CLARABEL"
    supports_quad_obj = True

    def setup(self, ctx: Any) -> None:
        """Sparsity patterns of P, A (equalities first) and the KKT matrix, the same for all items."""
        (p_rows, p_pointers, _), (a_rows, a_pointers, shape) = (
            reduced.problem_data_index for reduced in (ctx.reduced_P, ctx.reduced_A)
        )
        m, n, e = int(shape[0]), int(shape[1]) - 1, int(ctx.cone_dims.zero)
        self.rows, self.unknowns, self.equalities = m, n, e
        self.offset_rows, self.A_rows = a_rows[a_pointers[n] :], a_rows[: a_pointers[n]]
        self.A_columns = np.repeat(np.arange(n), np.diff(a_pointers[: n + 1]))
        p_columns = np.repeat(np.arange(n), np.diff(p_pointers))
        self.equal = self.A_rows < e
        self.cost = Pattern(p_rows, p_columns, (n, n))
        self.upper = Pattern(self.A_rows[self.equal], self.A_columns[self.equal], (e, n))
        self.lower = Pattern(self.A_rows[~self.equal] - e, self.A_columns[~self.equal], (m - e, n))
        diagonal = np.arange(n + m)
        self.kkt = Pattern(
            np.concatenate([p_rows, n + self.A_rows, self.A_columns, diagonal]),
            np.concatenate([p_columns, self.A_columns, n + self.A_rows, diagonal]),
            (n + m, n + m),
        )

    def solve_torch_batch(
        self, P: Tensor | None, q: Tensor, A: Tensor, dims: Any, solver_args: dict[str, Any], needs_grad: bool
    ) -> tuple[Tensor, Tensor, list[Optimum | None]]:
        """Primal (b, n), dual (b, m), and what the derivative needs."""
        costs = cast(Tensor, P).detach().numpy()
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            optima = list(pool.map(self._solve, costs, q.detach().numpy()[:, :-1], A.detach().numpy()))
        primal = [np.full(self.unknowns, np.nan) if o is None else o.x for o in optima]
        dual = [np.full(self.rows, np.nan) if o is None else o.y for o in optima]
        return torch.from_numpy(np.stack(primal)), torch.from_numpy(np.stack(dual)), optima

    def derivative_torch_batch(
        self, dprimal: Tensor, ddual: Tensor, saved_state: list[Optimum | None]
    ) -> tuple[None, Tensor, Tensor]:
        """Gradients with respect to q (b, n + 1) and the entries of [A | b]; P is a constant of the program."""
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            pulled = list(pool.map(self._pull_back, saved_state, dprimal.numpy(), ddual.numpy()))
        costs, entries = (torch.from_numpy(np.stack([p[i] for p in pulled])) for i in (0, 1))
        return None, costs, entries

    def _solve(self, P: Array, q: Array, table: Array) -> Optimum | None:
        if not (np.isfinite(table).all() and np.isfinite(q).all()):
            return None
        A, b = -table[: len(self.A_rows)], np.zeros(self.rows)
        b[self.offset_rows] = table[len(self.A_rows) :]
        return self._by_piqp(P, q, A, b) or self._by_clarabel(P, q, A, b)

    def _by_piqp(self, P: Array, q: Array, A: Array, b: Array) -> Optimum | None:
        solver, e = piqp.SparseSolver(), self.equalities
        solver.settings.eps_abs = solver.settings.eps_rel = TOLERANCE
        upper, lower = self.upper.matrix(A[self.equal]), self.lower.matrix(A[~self.equal])
        solver.setup(self.cost.matrix(P), q, upper, b[:e], lower, None, b[e:])
        if solver.solve() != piqp.PIQP_SOLVED:
            return None
        found = solver.result
        y, s = np.concatenate([found.y, found.z_u]), np.concatenate([np.zeros(e), found.s_u])
        return Optimum(np.array(found.x), y, s, P, A)

    def _by_clarabel(self, P: Array, q: Array, A: Array, b: Array) -> Optimum | None:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        cones = [clarabel.ZeroConeT(self.equalities), clarabel.NonnegativeConeT(self.rows - self.equalities)]
        stacked = sp.vstack(
            [self.upper.matrix(A[self.equal]), self.lower.matrix(A[~self.equal])], format="csc"
        )
        cost = sp.triu(self.cost.matrix(P), format="csc")
        found = clarabel.DefaultSolver(cost, q, stacked, b, cones, settings).solve()
        if found.status != clarabel.SolverStatus.Solved:
            return None
        return Optimum(np.array(found.x), np.array(found.z), np.array(found.s), P, A)

    def _pull_back(self, optimum: Optimum | None, dx: Array, dy: Array) -> tuple[Array, Array]:
        """Adjoint of P dx + A' dy = -(dq + dA' y), A dx - (s / y) dy = db - dA x."""
        if optimum is None or not (dx.any() or dy.any()):
            return np.zeros(self.unknowns + 1), np.zeros(len(self.A_rows) + len(self.offset_rows))
        u, v = np.split(self._solve_kkt(optimum, np.concatenate([dx, dy])), [self.unknowns])
        toward_A = optimum.y[self.A_rows] * u[self.A_columns] + v[self.A_rows] * optimum.x[self.A_columns]
        return np.append(-u, 0.0), np.concatenate([toward_A, v[self.offset_rows]])

    def _solve_kkt(self, optimum: Optimum, rhs: Array) -> Array:
        """[P A'; A -s/y] u = rhs by a quasi-definite factorisation, then refined."""
        e = self.equalities
        flexibility = np.zeros(self.rows)
        flexibility[e:] = np.clip(optimum.s[e:] / np.maximum(optimum.y[e:], 1e-300), 0, STIFFEST)
        diagonal = np.concatenate([np.zeros(self.unknowns), -flexibility])
        shift = REGULARISATION * np.concatenate([np.ones(self.unknowns), -np.ones(self.rows)])
        entries = np.concatenate([optimum.P, optimum.A, optimum.A])
        exact = self.kkt.matrix(np.concatenate([entries, diagonal]))
        factor = spl.splu(
            self.kkt.matrix(np.concatenate([entries, diagonal + shift])),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        u = factor.solve(rhs)
        for _ in range(REFINEMENTS):
            u = u + factor.solve(rhs - exact @ u)
        return u
