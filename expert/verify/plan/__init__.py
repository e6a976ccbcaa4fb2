"""Checks contact plans and proofs that there is none."""
