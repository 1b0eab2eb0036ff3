"""Georeferencing: from scans and motion to points (thesis 2.3)."""

from trueterrain.georeference.calibrate import Calibration, CalibrationSettings, calibrate
from trueterrain.georeference.points import georeference, mounting_of
from trueterrain.georeference.scans import Expansion, ScanGeometry
from trueterrain.georeference.screening import Screening

__all__ = [
    "Calibration",
    "CalibrationSettings",
    "Expansion",
    "ScanGeometry",
    "Screening",
    "calibrate",
    "georeference",
    "mounting_of",
]
