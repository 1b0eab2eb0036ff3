"""
How steep a face can a scanner see?
===================================

A beam cannot reach behind an edge: a face that falls away from the scanner more steeply than the
beam is in its own shadow. Straight below the laser every face is visible, 2 m to the side only
those up to 45 degrees, so that joints and potholes are measured incompletely there.

In the manner of thesis Fig. 3-14. The limit follows from geometry; the virtual scanner, which
does not use it, gives the same.
"""

import numpy as np

from trueterrain import figures
from trueterrain.formats.run import Mounting
from trueterrain.simulate.body import Parked
from trueterrain.simulate.ground import Step
from trueterrain.simulate.scanner import Scanner, ScannerStream

scanner = Scanner(range_noise=0.0, quantum=0.0, spot_rays=1, dropouts=0.0, intensity_noise=0.0)
still = Parked(up=2.0).knots(0.0, 0.01)


def is_seen(angle, offset, fall=0.3):
    """Whether a beam meets a face that falls off to the left by an angle."""
    face = Step(position=offset, rise=-fall, width=fall / np.tan(angle), direction=np.pi / 2)
    scans = ScannerStream(scanner, Mounting(), face, seed=1).record(still, 0.0, 0.001)
    depth = scans.true_range[0] * np.cos(scanner.angle) - 2.0
    return np.any((depth > 0.001) & (depth < fall - 0.001))


def limit(offset):
    """Steepest visible face, to 0.1 degrees, by bisection."""
    low, high = np.deg2rad([30.0, 89.9])
    while high - low > np.deg2rad(0.1):
        mean = 0.5 * (low + high)
        low, high = (mean, high) if is_seen(mean, offset) else (low, mean)
    return low


# %%
# One figure. The scanner of 940 beams is tried at six offsets.

offsets = np.array([0.3, 0.6, 0.9, 1.2, 1.5, 1.8])
limits = np.array([limit(offset) for offset in offsets])
figures.measurable_slope(2.0, 2.0, found={"found by the virtual scanner": (offsets, limits)})

# %%
# One number: the maximum difference from the limits by geometry. Beams are 0.1 degrees apart, and
# one of them has to meet the face.

difference = np.rad2deg(np.abs(limits - np.arctan2(2.0, offsets)).max())
print(f"{difference:.2f} degrees (maximum)")
