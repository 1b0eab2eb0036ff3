"""Georeferencing: points from scans and a trajectory; calibration of the mounting (thesis 2.3)."""

from trueterrain.georeference.calibrate import Calibration, CalibrationSettings, calibrate_mounting
from trueterrain.georeference.points import georeference, mounting_of
from trueterrain.georeference.scans import PoseExpansion, ScanGeometry
from trueterrain.georeference.screening import Screening

__all__ = [
    "Calibration",
    "CalibrationSettings",
    "PoseExpansion",
    "ScanGeometry",
    "Screening",
    "calibrate_mounting",
    "georeference",
    "mounting_of",
]
