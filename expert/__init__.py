"""Model-based planning and certification for point fingers that move a polygon in the plane."""
