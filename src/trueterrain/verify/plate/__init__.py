"""Calibration plates: design, parts, and their visibility to a scanner."""
