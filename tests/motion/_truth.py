"""Errors of a trajectory against the exact motion that a simulated run holds.

The truth is composed by scipy's rotations, without the package's own geometry.
"""

import numpy as np
from scipy.spatial.transform import Rotation

LASER = np.array([-2.25, 0.0, 1.2])  # [m] in the body, as in the ready scenes


def true_poses(run):
    """Times, positions (n, 3) and rotations of the body."""
    body = run["truth/body"]
    position = np.stack([body[name].values for name in ("east", "north", "up")], axis=1)
    angles = np.stack([body[name].values for name in ("yaw", "pitch", "roll")], axis=1)
    return body["time"].values, position, Rotation.from_euler("ZYX", angles)


class Errors:
    """Errors of a trajectory at the true knots, and its standard deviations."""

    def __init__(self, run, trajectory, point=LASER):
        time, position, rotation = true_poses(run)
        inside = (time >= trajectory.time[0]) & (time <= trajectory.time[-1])
        self.time, position, rotation = time[inside], position[inside], rotation[inside]
        found = trajectory.at(self.time)
        arm = found.rotation.apply(point)
        self.true_point = position + rotation.apply(point)
        self.point = found.position + arm - self.true_point
        self.origin = found.position - position
        self.rotation = (found.rotation * rotation.inv()).as_rotvec()
        self.flag = found.flag
        by = np.zeros((self.time.size, 6))  # derivative of the point's height
        by[:, 2], by[:, 3], by[:, 4] = 1.0, arm[:, 1], -arm[:, 0]
        self.up_sd = np.sqrt(np.einsum("ni,nij,nj->n", by, found.covariance, by))
        self.sd = np.sqrt(np.einsum("nii->ni", found.covariance))

    @property
    def up(self):
        """Error of the height of the point [m]."""
        return self.point[:, 2]


def rms(values, axis=None):
    """Root mean square."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def less_line(time, values):
    """Values less their regression line."""
    since = time - time.mean()
    return values - np.polyval(np.polyfit(since, values, 1), since)
