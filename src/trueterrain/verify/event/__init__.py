"""Excitation events: design, cut list and predicted response of a vehicle."""
