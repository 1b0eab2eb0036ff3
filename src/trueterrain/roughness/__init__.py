"""What a profile amounts to: quarter car and International Roughness Index (IRI, MRI, HRI)."""

from trueterrain.roughness.iri import IriOptions, continuous_iri, iri
from trueterrain.roughness.quarter_car import IRI_SPEED, QuarterCar

__all__ = ["IRI_SPEED", "IriOptions", "QuarterCar", "continuous_iri", "iri"]
