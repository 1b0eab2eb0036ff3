"""How true each stage is: comparison with ground that is known."""

from trueterrain.verify.truth import exact_trajectory, ground_errors, true_ground, truth_of

__all__ = ["exact_trajectory", "ground_errors", "true_ground", "truth_of"]
