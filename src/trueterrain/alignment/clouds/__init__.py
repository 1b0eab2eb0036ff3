"""Passes in point clouds: strips of files, their times or stations, and corrected clouds."""
