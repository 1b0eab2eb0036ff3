"""Georeferencing: from scans and motion to points, every return at its own time (thesis 2.3)."""
