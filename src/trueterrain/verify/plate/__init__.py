"""Calibration surfaces: design, parts, and what a scanner sees of them."""
