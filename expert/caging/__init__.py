"""Cages: arrangements of point fingers and walls that an object cannot leave (Thesis 5.1)."""
