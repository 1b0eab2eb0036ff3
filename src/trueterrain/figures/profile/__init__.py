"""Figures of profiles and of the search areas they come from."""
