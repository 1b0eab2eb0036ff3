"""Gathering heights inside search areas, from grids and from scattered points."""
