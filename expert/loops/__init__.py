"""Loops of obstacles around an object: shared by cages and by nested cages."""
