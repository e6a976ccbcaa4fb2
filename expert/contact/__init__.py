"""Contact-trajectory optimization (Thesis 3.1)."""

from expert.contact.solve import solve

__all__ = ["solve"]
