"""Observations of the adjustment: ground that several passes saw, cell by cell."""
