"""Geometry: plane curves with stations, grids along them, rotations, geodesy, coordinate reference systems."""
