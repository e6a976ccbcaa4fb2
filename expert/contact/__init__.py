"""Contact-trajectory optimization (Thesis 3.1)."""
