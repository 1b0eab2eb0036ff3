"""Verification: accuracy of each stage by comparison with known ground."""

from trueterrain.verify.truth import exact_trajectory, ground_errors, true_ground, truth_of

__all__ = ["exact_trajectory", "ground_errors", "true_ground", "truth_of"]
