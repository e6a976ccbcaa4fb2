"""The nouns that every problem kind shares: shapes, walls, motions, fingers, frames.

Index legend, fixed everywhere: t step, c finger, f facet, j|k end point or cone ray, d coordinate; all count from 0.
SI units, angles in rad, counter-clockwise, y up; suffix `_w` world frame, `_b` body frame.
"""
