"""Outlines of cams: superellipses |x / a|^n + |z / b|^n = 1, of which a disc is one."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.profile.envelope._strip import Strip

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Superellipse:
    """Lower half of a superellipse whose axes stay level and upright."""

    half_length: float
    "Half axis along the path [m]."

    half_height: float
    "Half axis upward [m]."

    order: float
    "Exponent; 2 is an ellipse."

    def drop(self, x: Float) -> Float:
        """How far the outline lies above its lowest point [m]; infinite beyond its ends."""
        share = np.abs(x) / self.half_length
        inside = np.minimum(share, 1.0) ** self.order
        above = self.half_height * (1 - (1 - inside) ** (1 / self.order))
        return np.where(share <= 1, above, np.inf)

    def slope(self, x: Float) -> Float:
        """Slope of the outline [m/m]; infinite at its ends and beyond."""
        share = np.abs(x) / self.half_length
        inside = np.minimum(share, 1.0) ** self.order
        with np.errstate(divide="ignore"):
            steep = (inside / (1 - inside)) ** ((self.order - 1) / self.order)
        return np.sign(x) * np.where(share < 1, steep * self.half_height / self.half_length, np.inf)

    def stand_on(self, strip: Strip, line: list[int], shift: list[float]) -> tuple[Float, Float]:
        """Heights of cams that stand on the ground, and the slope where they touch it.

        Parameters
        ----------
        strip : Strip
            Ground.
        line : list of int
            Line under each cam.
        shift : list of float
            How far each cam is ahead of the path point [m].

        Returns
        -------
        height, slope : numpy.ndarray, shape (s, cam)
            Height of the lowest point of each cam [m] and slope of its tangent there [m/m]; NaN
            where there is no ground under it.
        """
        from trueterrain.profile.envelope import _kernels

        samples = int(2 * self.half_length / strip.step) + 1  # most that a cam may touch
        place = np.array(shift)
        lead = np.ceil((place - self.half_length) / strip.step).astype(np.int64)
        x = (lead[:, None] + np.arange(-1, samples + 1)) * strip.step - place[:, None]
        height = np.empty((strip.count, len(line)))
        slope = np.empty_like(height)
        _kernels.cam_heights(
            strip.height, strip.first, strip.stride, strip.step, np.array(line), lead,
            self.drop(x[:, 1:-1]), self.slope(x), place, self.half_length, self.half_height,
            self.order, height, slope,
        )  # fmt: skip
        return height, slope
