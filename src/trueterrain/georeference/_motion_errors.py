"""Motion error model: errors of the trajectory that vary within a pass.

East, north, up, roll, pitch and yaw of a pass each have an error that is a first-order Gauss-Markov
process of time, with the standard deviation that the trajectory reports and an assumed correlation
time. In the least squares each process is a piecewise linear function with some knots; covariances
are computed from the process itself, in steps in which the vehicle passes less than a cell.

Source: Maybeck (1979) "Stochastic models, estimation, and control", volume 1, section 4.11.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Errors of the motion: east, north, up, and rotations about the axes of the body.
COMPONENTS = 6

_MAX_PIECES = 24  # pieces of the piecewise linear function of a pass
_MIN_STEP = 0.005  # [s] in which the vehicle passes less than a cell
_MAX_STEPS = 50_000  # of a pass
_UP = 2  # index of the height among the components
_DRIFT_TIMES = 0.1, 1e5  # [s] bounds of the correlation time of heights
_DATUM_SD = 1e-4  # standard deviations, of the height at the centre of a pass: its datum


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionErrorModel:
    """Gauss-Markov errors of the motion of all passes, as piecewise linear functions of time.

    Unknowns are the values at the knots: pass by pass, component by component (those with a
    standard deviation greater than 0), knot by knot. Height errors are 0 at the centre of a pass,
    whose height is the offset of the pass.
    """

    knots: tuple[Floats, ...]
    "Times of the knots of each pass, at least two [s]."

    sd: Floats
    "Standard deviations of east, north, up [m], roll, pitch, yaw [rad], shape (pass, 6)."

    correlation_time: Floats
    "Correlation times of the six components, shape (6,) [s]."

    @classmethod
    def over(
        cls, times: list[Floats], sd: Floats, correlation_time: Floats, step: float
    ) -> "MotionErrorModel":
        """Model with knots a step apart, or further in long passes.

        Parameters
        ----------
        times : list of numpy.ndarray
            Times at which each pass sees ground that others see as well [s]; NaN elsewhere.
        sd : numpy.ndarray, shape (pass, 6)
            Standard deviations.
        correlation_time : numpy.ndarray, shape (6,)
            Correlation times [s].
        step : float
            Time from knot to knot [s].

        Returns
        -------
        MotionErrorModel
            Of all passes.
        """
        knots = []
        for time in times:
            seen = time[np.isfinite(time)]
            begin, end = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 0.0)
            end = max(end, begin + _MIN_STEP)
            pieces = min(max(1, math.ceil((end - begin) / step)), _MAX_PIECES)
            knots.append(np.linspace(begin, end, pieces + 1))
        return cls(knots=tuple(knots), sd=sd, correlation_time=correlation_time)

    @cached_property
    def uncertain(self) -> list[npt.NDArray[np.intp]]:
        """Components of each pass that are unknowns."""
        return [np.flatnonzero(sd > 0) for sd in self.sd]

    @cached_property
    def first(self) -> list[int]:
        """Index of the first unknown of each pass, and the number of all."""
        sizes = [c.size * k.size for c, k in zip(self.uncertain, self.knots, strict=True)]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.first[-1]

    @cached_property
    def horizontal(self) -> npt.NDArray[np.bool_]:
        """Which unknowns are errors of east or north, shape (size,)."""
        parts = [np.repeat(c < 2, k.size) for c, k in zip(self.uncertain, self.knots, strict=True)]
        return np.concatenate(parts)

    @cached_property
    def precision(self) -> Floats:
        """Inverse covariance of the unknowns, shape (size, size): tridiagonal Markov chains."""
        total = np.zeros((self.size, self.size))
        for p, knots in enumerate(self.knots):
            for j, component in enumerate(self.uncertain[p]):
                lag = np.diff(knots) / self.correlation_time[component]
                new = -np.expm1(-2.0 * lag)
                diagonal = np.concatenate([[1.0], 1.0 / new])
                diagonal[:-1] += np.exp(-2.0 * lag) / new
                off_diagonal = -np.exp(-lag) / new
                if component == _UP:
                    diagonal[knots.size // 2] += _DATUM_SD**-2
                chain = np.diag(diagonal) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1)
                at = self.first[p] + j * knots.size
                part = slice(at, at + knots.size)
                total[part, part] = chain / self.sd[p, component] ** 2
        return total

    def with_estimated_drift_time(self, unknown: Floats, covariance: Floats) -> "MotionErrorModel":
        """Model with the correlation time of heights estimated from the data.

        Heights are usually much steadier within a pass than the reported standard deviations and
        the assumed correlation time imply. The common ground of passes determines the steps of
        their heights from knot to knot. The variance of these is re-estimated as the sum of their
        normalised squares over their effective number, that is those which the data determine
        (MacKay 1992, "Bayesian interpolation", equation 4.10).

        Parameters
        ----------
        unknown : numpy.ndarray, shape (size,)
            Values at the knots.
        covariance : numpy.ndarray, shape (size, size)
            Their covariance.

        Returns
        -------
        MotionErrorModel
            With another correlation time of heights.
        """
        squares, determined = 0.0, 0.0  # of normalised steps; effective number of steps
        for p, knots in enumerate(self.knots):
            found = np.flatnonzero(self.uncertain[p] == _UP)
            if not found.size:
                continue
            at = self.first[p] + int(found[0]) * knots.size + np.arange(knots.size)
            part = covariance[np.ix_(at, at)]
            step_variance = np.diag(part)[1:] + np.diag(part)[:-1] - 2.0 * np.diag(part, 1)
            # prior variance of a step: 2 sd^2 (1 - exp(-step / time))
            expected = (
                -2.0 * self.sd[p, _UP] ** 2 * np.expm1(-np.diff(knots) / self.correlation_time[_UP])
            )
            squares += float(np.sum(np.diff(unknown[at]) ** 2 / expected))
            determined += float(np.sum(np.clip(1.0 - step_variance / expected, 0.0, 1.0)))
        if not determined:
            return self
        correlation_time = self.correlation_time.copy()
        # posterior mean of the correlation time rather than its mode, for a finite number of steps
        factor = determined / (determined + 2.0) * determined / max(squares, 1e-12)
        correlation_time[_UP] = np.clip(correlation_time[_UP] * factor, *_DRIFT_TIMES)
        return replace(self, correlation_time=correlation_time)

    def locate(self, p: int, time: Floats) -> tuple[npt.NDArray[np.intp], Floats]:
        """Piece in which each time lies, and the position within it, from 0 to 1."""
        knots = self.knots[p]
        at = np.clip((time - knots[0]) / (knots[1] - knots[0]), 0.0, knots.size - 1.0)
        piece = np.minimum(at.astype(np.intp), knots.size - 2)
        return piece, at - piece

    def interpolate(self, p: int, unknown: Floats, component: int, time: Floats) -> Floats:
        """Error of a component at some times; 0 if the component has no error."""
        found = np.flatnonzero(self.uncertain[p] == component)
        if not found.size:
            return np.zeros_like(time)
        at = self.first[p] + int(found[0]) * self.knots[p].size
        return np.interp(time, self.knots[p], unknown[at : at + self.knots[p].size])

    def columns(self, p: int, piece: int) -> npt.NDArray[np.intp]:
        """Unknowns of a piece: of each component at its begin, then at its end."""
        size = self.knots[p].size
        begin = self.first[p] + np.arange(self.uncertain[p].size) * size + piece
        return np.concatenate([begin, begin + 1])

    def height_changes(self, unknown: Floats, effect: Floats, time: Floats) -> Floats:
        """Changes of heights by the errors.

        Parameters
        ----------
        unknown : numpy.ndarray, shape (size, m)
            Values at the knots, for m cases.
        effect : numpy.ndarray, shape (pass, cell, 6)
            Derivatives of heights by the errors.
        time : numpy.ndarray, shape (pass, cell)
            Time at which each pass sees the cell [s].

        Returns
        -------
        numpy.ndarray, shape (pass, cell, m)
            Changes of the heights.
        """
        total = np.zeros((*time.shape, unknown.shape[1]))
        for p, components in enumerate(self.uncertain):
            piece, x = self.locate(p, time[p])
            for j, component in enumerate(components):
                at = self.first[p] + j * self.knots[p].size + piece
                value = (1.0 - x)[:, None] * unknown[at] + x[:, None] * unknown[at + 1]
                total[p] += effect[p, :, component, None] * value
        return total

    def covariance(self, leverage: Floats, effect: Floats, time: Floats) -> Floats:
        """Covariance of weighted sums of heights under the Gauss-Markov processes.

        Parameters
        ----------
        leverage : numpy.ndarray, shape (pass, cell, m)
            Weight of each height in each sum.
        effect, time : numpy.ndarray
            As in `height_changes`.

        Returns
        -------
        numpy.ndarray, shape (m, m)
            Covariance of the sums.
        """
        from scipy.signal import lfilter

        m = leverage.shape[2]
        total = np.zeros((m, m))
        for p, components in enumerate(self.uncertain):
            begin, span = self.knots[p][0], float(np.ptp(self.knots[p]))
            step = max(_MIN_STEP, span / _MAX_STEPS)
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
                    centre = round((self.knots[p][self.knots[p].size // 2] - begin) / step)
                    sums[:, centre] -= sums.sum(axis=1)  # errors relative to that of the centre
                # sum over pairs of exp(-|lag| / time) in linear time: a recursive filter gives the
                # sums over all earlier steps; later ones by symmetry
                factor = math.exp(-step / self.correlation_time[component])
                before = lfilter([0.0, factor], [1.0, -factor], sums, axis=1)
                crossed = sums @ before.T
                part = sums @ sums.T + crossed + crossed.T
                total += self.sd[p, component] ** 2 * part
        return total
