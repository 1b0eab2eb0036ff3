"""Figures of accuracy tests: events, calibration surfaces, results."""
