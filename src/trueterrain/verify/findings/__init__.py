"""Findings: faults that a test looks for, with their estimates."""
