"""A run over plate and floor with prescribed heave, pitch and roll of the body."""

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting
from trueterrain.motion import Trajectory

from ._plates import height_at

SPEED = 5.0  # [m/s]
BEGIN = 8.0  # [m] where the plate begins, from the body at the time 0
DURATION = 3.6  # [s]
LEVER = (-1.0, 0.0, 0.5)  # [m] of the scanner
HIGH = 1.5  # [m] of the body over the ground

#: Sines of heave [m], pitch and roll [rad]: amplitude, frequency [Hz] and phase.
WAVES = {
    "heave": ((0.006, 1.7, 0.3), (0.003, 5.3, 1.0), (0.001, 11.0, 2.0)),
    "pitch": ((0.006, 2.6, 0.9), (0.002, 10.3, 0.0)),
    "roll": ((0.006, 2.1, 0.5),),
}


def wave(name, time, waves):
    """A motion and its rate."""
    value, rate = np.zeros_like(time), np.zeros_like(time)
    for size, frequency, phase in waves.get(name, ()):
        turn = 2 * np.pi * frequency
        value += size * np.sin(turn * time + phase)
        rate += size * turn * np.cos(turn * time + phase)
    return value, rate


def motion(waves=WAVES, *, scale=1.0, duration=DURATION):
    """Trajectory that knows heave, pitch and roll times a scale."""
    time = np.arange(-0.05, duration + 0.05, 0.001)
    (up, up_rate), (pitch, pitch_rate), (roll, roll_rate) = (
        scale * np.stack(wave(name, time, waves)) for name in ("heave", "pitch", "roll")
    )
    zero = np.zeros_like(time)
    turned = Rotation.from_euler("ZYX", np.stack([zero, pitch, roll], axis=-1))
    spin = [roll_rate, pitch_rate * np.cos(roll), -pitch_rate * np.sin(roll)]
    return Trajectory(
        time=time,
        position=np.stack([SPEED * time, zero, HIGH + up], axis=-1),
        velocity=np.stack([zero + SPEED, zero, up_rate], axis=-1),
        angular_velocity=np.stack(spin, axis=-1),
        quaternion=turned.as_quat(),
        covariance=np.zeros((time.size, 6, 6)),
        flag=np.zeros(time.size, np.uint8),
    )


def driven(waves=WAVES, *, noise=1e-4, seed=1, declared=None, white=None, drop=0, beside=0.0):
    """Run with a scan every millisecond, and its stated mounting."""
    begin = BEGIN + beside
    time = np.arange(0, DURATION, 0.001)
    angle = np.linspace(-0.03, 0.03, 9)
    poses = motion(waves).at(time)
    laser = poses.position + poses.rotation.apply(LEVER)
    beams = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=-1)
    ahead, up = np.einsum("nij,bj->inb", poses.rotation.as_matrix(), beams)[[0, 2]]
    ranges = np.full(up.shape, HIGH)
    for _ in range(6):
        ground = height_at(laser[:, :1] + ranges * ahead - begin)
        ranges = (ground - laser[:, 2:]) / up
    place = laser[:, :1] + ranges * ahead - begin
    intensity = np.full(up.shape, 5000.0)
    if white is not None:  # a stripe on the plate, seen 0.5 mm too high
        stripe = (place >= white[0]) & (place <= white[1])
        intensity[stripe], ranges[stripe] = 25000.0, ranges[stripe] - 5e-4
    ranges = ranges + noise * np.random.default_rng(seed).normal(size=ranges.shape)
    kept = np.ones(time.size, bool)
    kept[500 : 500 + drop] = False
    scans = xr.Dataset(
        {
            "time": ("scan", time[kept], {"units": "s"}),
            "range": (("scan", "beam"), ranges[kept], {"units": "m"}),
            "intensity": (("scan", "beam"), intensity[kept]),
            "angle": ("beam", angle, {"units": "rad"}),
            "delay": ("beam", np.zeros(angle.size), {"units": "s"}),
        }
    )
    # accelerometers are there; the trajectory tells what they made of the motion
    sensors = xr.Dataset({"time": ("sample", time)})
    tree = xr.DataTree.from_dict({"/scans": scans, "/accelerometers": sensors})
    tree.attrs["mounting"] = Mounting(**({"scanner_position": LEVER} | (declared or {}))).to_attrs()
    return tree
