"""Geometry: plane curves, grid frames, rotations, geodesy, coordinate reference systems."""
