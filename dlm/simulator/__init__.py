"""Batched, differentiable planar contact simulator (Thesis 4-CT8..4-CT10)."""
