"""Findings: faults that a test looked for, and what it found."""
