"""Differentiable learning of manipulation from video (Thesis Ch. 4)."""
