"""Checkers that share only geometry and mechanics with the solvers they check."""
