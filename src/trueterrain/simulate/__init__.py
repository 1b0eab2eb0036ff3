"""Simulation: ground that the package makes itself, whose truth is known."""
