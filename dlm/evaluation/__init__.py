"""Judging actions by what they do in the simulator: Table 4.1, training curves, pictures, one report."""
