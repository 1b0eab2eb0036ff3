"""Figures of surfaces and point clouds."""
