"""Outlines of cams: superellipses |x / a|^n + |z / b|^n = 1, of which a disc is one."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.profile.envelope._strip import GroundStrip

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

    def stand_on(
        self,
        strip: GroundStrip,
        groups: list[tuple[int, int]],
        group: list[int],
        shift: list[float],
    ) -> tuple[Float, Float]:
        """Heights of cams that stand on the ground, and the slope where they touch it.

        Parameters
        ----------
        strip : Strip
            Ground.
        groups : list of tuple of int
            First line and line behind the last one of each group of lines.
        group : list of int
            Group of lines under each cam.
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
            place,
            self.half_length,
            self.half_height,
            self.order,
            height,
            slope,
        )
        return height, slope

    def _bounds(self, x: Float, step: float) -> tuple[Float, Float]:
        """How far the outline lies at least below either end of a piece of ground that it touches.

        The outline is convex: between two samples it bulges below its chord by at most a quarter of
        the step times the change of its slope. Where it ends, it is at least as high as within.
        """
        drop, slope = self.drop(x), self.slope(x)
        begin, end = drop[:, :-1], drop[:, 1:]
        with np.errstate(invalid="ignore"):
            bulge = step / 4 * np.diff(slope, axis=1)
            at_end = np.minimum(begin, end)  # at an end of the cam, or infinite beyond it
            inner = np.isfinite(bulge)
            return np.where(inner, begin - bulge, at_end), np.where(inner, end - bulge, at_end)
