"""Small dense programs that several solvers use."""
