"""Figures of roughness: indices, spectra, evenness, agreement."""
