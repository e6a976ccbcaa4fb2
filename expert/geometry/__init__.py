"""Exact planar geometry: poses, polygons, convex covers.  Shared by solvers and checkers alike."""
