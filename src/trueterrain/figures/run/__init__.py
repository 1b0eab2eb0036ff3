"""Figures of recorded runs: motion, navigation, ranges, scans, spectra."""
