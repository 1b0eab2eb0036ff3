"""Figures of passes brought into agreement."""
