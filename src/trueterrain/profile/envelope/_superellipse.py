"""Outlines of cams: superellipses |x / a|^n + |z / b|^n = 1, of which a disc is one."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.profile.envelope import _kernels
from trueterrain.profile.envelope._strip import GroundStrip

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Superellipse:
    """Lower half of a superellipse with a level and a vertical axis."""

    half_length: float
    "Half axis along the path [m]."

    half_height: float
    "Vertical half axis [m]."

    order: float
    "Exponent; 2 is an ellipse."

    def drop(self, x: Float) -> Float:
        """Height of the outline above its lowest point [m]; infinite beyond its ends."""
        fraction = np.abs(x) / self.half_length
        inside = np.minimum(fraction, 1.0) ** self.order
        above = self.half_height * (1 - (1 - inside) ** (1 / self.order))
        return np.where(fraction <= 1, above, np.inf)

    def slope(self, x: Float) -> Float:
        """Slope of the outline [m/m]; infinite at its ends and beyond."""
        fraction = np.abs(x) / self.half_length
        inside = np.minimum(fraction, 1.0) ** self.order
        with np.errstate(divide="ignore"):
            steepness = (inside / (1 - inside)) ** ((self.order - 1) / self.order)
        slope = steepness * self.half_height / self.half_length
        return np.sign(x) * np.where(fraction < 1, slope, np.inf)

    def stand_on(
        self,
        strip: GroundStrip,
        groups: list[tuple[int, int]],
        group: list[int],
        shift: list[float],
    ) -> tuple[Float, Float]:
        """Heights of cams on the ground, and the slope at the point of contact.

        Parameters
        ----------
        strip : GroundStrip
            Ground.
        groups : list of tuple of int
            First line, and one after the last, of each group of lines.
        group : list of int
            Group of lines under each cam.
        shift : list of float
            Longitudinal position of each cam relative to the path point [m].

        Returns
        -------
        height, slope : numpy.ndarray, shape (s, cam)
            Height of the lowest point of each cam [m] and slope of its tangent there [m/m]; NaN
            where there is no ground under it.
        """
        samples = int(2 * self.half_length / strip.step) + 1  # under a cam, at most
        position = np.array(shift)
        lead = np.ceil((position - self.half_length) / strip.step).astype(np.int64)
        x = (lead[:, None] + np.arange(-1, samples + 1)) * strip.step - position[:, None]
        top = np.stack([np.fmax.reduce(strip.height[begin:end]) for begin, end in groups])
        height = np.empty((strip.count, len(group)))
        slope = np.empty_like(height)
        _kernels.cam_heights(
            strip.height,
            top,
            np.array(group),
            np.array(groups),
            strip.first,
            strip.stride,
            strip.step,
            lead,
            self.drop(x[:, 1:-1]),
            self.slope(x),
            *self._bounds(x, strip.step),
            position,
            self.half_length,
            self.half_height,
            self.order,
            height,
            slope,
        )
        return height, slope

    def _bounds(self, x: Float, step: float) -> tuple[Float, Float]:
        """Lower bounds of the drop between samples, relative to either sample.

        A piece of ground can hold the cam no higher than its end heights less these bounds. The
        outline is convex: between two samples it lies below its chord by at most a quarter of the
        step times the change of its slope. Beyond its ends it counts as at least as high as within.
        """
        drop, slope = self.drop(x), self.slope(x)
        begin, end = drop[:, :-1], drop[:, 1:]
        with np.errstate(invalid="ignore"):
            bulge = step / 4 * np.diff(slope, axis=1)
            at_end = np.minimum(begin, end)  # at an end of the cam, or infinite beyond it
            inner = np.isfinite(bulge)
            return np.where(inner, begin - bulge, at_end), np.where(inner, end - bulge, at_end)
