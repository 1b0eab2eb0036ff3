"""Errors of the motion that wander within a pass.

East, north, up, roll, pitch and yaw of a pass are each wrong by a first-order Gauss-Markov process
of time, as large as the trajectory claims and as slow as is assumed. In the least squares it is a
broken line through some knots; what the standard deviations need is told by the process itself, in
steps as fine as the ground passes by.

Source: Maybeck (1979) "Stochastic models, estimation, and control", volume 1, section 4.11.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Errors of the motion: east, north, up, and turns about the axes of the body.
COMPONENTS = 6

_MOST = 24  # pieces of the broken line of a pass
_FINE = 0.005  # [s] in which the ground passes by less than a cell
_FINEST = 50_000  # such steps of a pass
_UP = 2  # place of the height among the components
_LENGTHS = 0.1, 1e5  # [s] times of correlation of heights that are believed
_NOTHING = 1e-4  # standard deviations that the height in the middle of a pass may be off


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionErrorModel:
    """What is known of the errors of all passes, and the broken lines that stand for them.

    Unknowns are the values at the knots: pass by pass, of each of its components that is uncertain
    at all, knot by knot. Heights count from the middle of the pass, whose height is its offset.
    """

    knots: tuple[Floats, ...]
    "Times of the knots of each pass, two at least [s]."

    sd: Floats
    "Standard deviations of east, north, up [m], roll, pitch, yaw [rad] of each, shape (pass, 6)."

    length: Floats
    "Times after which the autocorrelation of each of the six is 1/e [s]."

    @classmethod
    def over(
        cls, times: list[Floats], sd: Floats, length: Floats, step: float
    ) -> "MotionErrorModel":
        """With knots a step apart, or further in passes that are long.

        Parameters
        ----------
        times : list of numpy.ndarray
            Times at which each pass sees ground that others see [s]; NaN where it sees none.
        sd : numpy.ndarray, shape (pass, 6)
            Standard deviations.
        length : numpy.ndarray, shape (6,)
            Times of correlation [s].
        step : float
            Time from knot to knot [s].

        Returns
        -------
        Wander
            Of all passes.
        """
        knots = []
        for time in times:
            seen = time[np.isfinite(time)]
            begin, end = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 0.0)
            end = max(end, begin + _FINE)
            pieces = min(max(1, math.ceil((end - begin) / step)), _MOST)
            knots.append(np.linspace(begin, end, pieces + 1))
        return cls(knots=tuple(knots), sd=sd, length=length)

    @cached_property
    def uncertain(self) -> list[npt.NDArray[np.intp]]:
        """Components of each pass that are unknowns."""
        return [np.flatnonzero(sd > 0) for sd in self.sd]

    @cached_property
    def first(self) -> list[int]:
        """First unknown of each pass, and the number of all."""
        sizes = [c.size * k.size for c, k in zip(self.uncertain, self.knots, strict=True)]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.first[-1]

    @cached_property
    def aside(self) -> npt.NDArray[np.bool_]:
        """Which unknowns move a pass east or north."""
        parts = [np.repeat(c < 2, k.size) for c, k in zip(self.uncertain, self.knots, strict=True)]
        return np.concatenate(parts)

    @cached_property
    def precision(self) -> Floats:
        """Inverse covariance of the unknowns, shape (size, size): that of a Markov chain each."""
        whole = np.zeros((self.size, self.size))
        for p, knots in enumerate(self.knots):
            for j, component in enumerate(self.uncertain[p]):
                lag = np.diff(knots) / self.length[component]
                new = -np.expm1(-2.0 * lag)
                diagonal = np.concatenate([[1.0], 1.0 / new])
                diagonal[:-1] += np.exp(-2.0 * lag) / new
                beside = -np.exp(-lag) / new
                if component == _UP:
                    diagonal[knots.size // 2] += _NOTHING**-2
                chain = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
                at = self.first[p] + j * knots.size
                part = slice(at, at + knots.size)
                whole[part, part] = chain / self.sd[p, component] ** 2
        return whole

    def as_seen(self, unknown: Floats, covariance: Floats) -> "MotionErrorModel":
        """The same with the time of correlation of heights as the ground tells it.

        All of the ground tells how much the heights of passes move against each other from knot to
        knot, and heights are rarely as restless as they are uncertain. The steps, squared, over
        those of them that are told (MacKay 1992, "Bayesian interpolation", equation 4.10).

        Parameters
        ----------
        unknown : numpy.ndarray, shape (size,)
            Values at the knots.
        covariance : numpy.ndarray, shape (size, size)
            Covariance that they have.

        Returns
        -------
        Wander
            With another time of correlation of heights.
        """
        walked, told = 0.0, 0.0
        for p, knots in enumerate(self.knots):
            found = np.flatnonzero(self.uncertain[p] == _UP)
            if not found.size:
                continue
            at = self.first[p] + int(found[0]) * knots.size + np.arange(knots.size)
            part = covariance[np.ix_(at, at)]
            spread = np.diag(part)[1:] + np.diag(part)[:-1] - 2.0 * np.diag(part, 1)
            expected = -2.0 * self.sd[p, _UP] ** 2 * np.expm1(-np.diff(knots) / self.length[_UP])
            walked += float(np.sum(np.diff(unknown[at]) ** 2 / expected))
            told += float(np.sum(np.clip(1.0 - spread / expected, 0.0, 1.0)))
        if not told:
            return self
        length = self.length.copy()
        # the mean of what so few steps leave open, which is more than what is likeliest
        likely = told / (told + 2.0) * told / max(walked, 1e-12)
        length[_UP] = np.clip(length[_UP] * likely, *_LENGTHS)
        return replace(self, length=length)

    def place(self, p: int, time: Floats) -> tuple[npt.NDArray[np.intp], Floats]:
        """Piece of the broken line of a pass, and how far within it, from 0 to 1."""
        knots = self.knots[p]
        at = np.clip((time - knots[0]) / (knots[1] - knots[0]), 0.0, knots.size - 1.0)
        piece = np.minimum(at.astype(np.intp), knots.size - 2)
        return piece, at - piece

    def line(self, p: int, unknown: Floats, component: int, time: Floats) -> Floats:
        """Value of a broken line at some times; 0 of a component that is certain."""
        found = np.flatnonzero(self.uncertain[p] == component)
        if not found.size:
            return np.zeros_like(time)
        at = self.first[p] + int(found[0]) * self.knots[p].size
        return np.interp(time, self.knots[p], unknown[at : at + self.knots[p].size])

    def columns(self, p: int, piece: int) -> npt.NDArray[np.intp]:
        """Unknowns that matter in a piece: of each component at its begin, then at its end."""
        size = self.knots[p].size
        begin = self.first[p] + np.arange(self.uncertain[p].size) * size + piece
        return np.concatenate([begin, begin + 1])

    def caused(self, unknown: Floats, effect: Floats, time: Floats) -> Floats:
        """What the broken lines do to heights.

        Parameters
        ----------
        unknown : numpy.ndarray, shape (size, m)
            Values at the knots, of m cases.
        effect : numpy.ndarray, shape (pass, cell, 6)
            Derivative of heights by the errors.
        time : numpy.ndarray, shape (pass, cell)
            When each pass saw the cell [s].

        Returns
        -------
        numpy.ndarray, shape (pass, cell, m)
            Changes of the heights.
        """
        whole = np.zeros((*time.shape, unknown.shape[1]))
        for p, components in enumerate(self.uncertain):
            piece, x = self.place(p, time[p])
            for j, component in enumerate(components):
                at = self.first[p] + j * self.knots[p].size + piece
                value = (1.0 - x)[:, None] * unknown[at] + x[:, None] * unknown[at + 1]
                whole[p] += effect[p, :, component, None] * value
        return whole

    def covariance(self, leverage: Floats, effect: Floats, time: Floats) -> Floats:
        """Covariance that the processes themselves give to some sums of heights.

        Parameters
        ----------
        leverage : numpy.ndarray, shape (pass, cell, m)
            By how much each height counts in each sum.
        effect, time : numpy.ndarray
            As of `caused`.

        Returns
        -------
        numpy.ndarray, shape (m, m)
            Of the sums.
        """
        from scipy.signal import lfilter

        m = leverage.shape[2]
        whole = np.zeros((m, m))
        for p, components in enumerate(self.uncertain):
            begin, span = self.knots[p][0], float(np.ptp(self.knots[p]))
            step = max(_FINE, span / _FINEST)
            count = math.ceil(span / step) + 1
            at = np.clip(np.rint((time[p] - begin) / step), 0, count - 1).astype(np.intp)
            for component in components:
                sums = np.stack(
                    [
                        np.bincount(at, effect[p, :, component] * column, minlength=count)
                        for column in leverage[p].T
                    ]
                )
                if component == _UP:
                    middle = round((self.knots[p][self.knots[p].size // 2] - begin) / step)
                    sums[:, middle] -= sums.sum(axis=1)
                kept = math.exp(-step / self.length[component])
                before = lfilter([0.0, kept], [1.0, -kept], sums, axis=1)
                crossed = sums @ before.T
                part = sums @ sums.T + crossed + crossed.T
                whole += self.sd[p, component] ** 2 * part
        return whole
