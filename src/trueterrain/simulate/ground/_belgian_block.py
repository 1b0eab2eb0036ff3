"""Belgian block: rows of hewn stones across the road, as on proving grounds."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trueterrain.simulate.ground import _kernels
from trueterrain.simulate.ground._ground import (
    Floats,
    Ground,
    check_finite,
    check_fraction,
    check_not_negative,
    check_positive,
    check_seed,
    rotate_axes,
)

_POSITIVE = (
    "row_pitch",
    "row_waviness_length",
    "block_pitch",
    "shoulder",
    "texture_length",
    "field_length",
    "field_width",
    "field_ramp",
    "lane_ramp",
    "undulation_length",
)
_NOT_NEGATIVE = (
    "row_scatter",
    "row_waviness",
    "block_scatter",
    "block_slant",
    "bond_scatter",
    "joint_width",
    "joint_depth",
    "height_scatter",
    "tilt_scatter",
    "texture",
    "field_scatter",
    "undulation",
)
_FRACTIONS = ("joint_depth_scatter", "bedding", "field_ramp_scatter")


@dataclass(frozen=True, kw_only=True)
class BelgianBlock(Ground):
    """Unbounded Belgian block pavement: single blocks with joints, in a chequered bed.

    The defaults make a road like the one in ``belgian_block.crg`` (ASAM OpenCRG sample data, a
    proving-ground road measured by DaimlerChrysler, 10 m x 3.0 m without the ragged right edge, on
    a grid of 1 cm). Its statistics are:

    - The height about the plane has an RMS of 24.4 mm (24.1 mm with the ragged edge). Nearly all
      of it comes from a *chequered* bed: fields 1.12 m long, high and low by about 25 mm in turn,
      with opposite signs left and right of a line along the road (correlation -0.7). So 5 % of
      the ground is below -39 mm, 50 % below 4 mm and 95 % below 37 mm.
    - The pitch of rows is 172 mm (peak of the spectrum of the joints at 5.8 1/m), that of blocks in
      a row 196 mm (5.1 1/m). Interquartile range of the distances between the centres of
      neighbouring blocks: 161 to 180 mm along, 178 to 210 mm across. The bond is irregular.
    - Joints between rows are on average 8.8 mm deep and 41 mm wide at half their depth, those
      between the blocks of a row 7.9 mm and 35 mm, at the resolution of this grid.
    - The tops are crowned (second-order coefficients -0.9 1/m along and -0.5 1/m across) and rise
      by 32 mm/m in the direction of the road (median): each row ends with a step down.
    - RMS difference of heights along the road: 2.4 mm over 10 mm, 8.5 mm over 50 mm, 16.2 mm over
      170 mm, 31 mm over 0.5 m, 43 mm over 1 m; across: 2.0, 6.1, 10.3, 21 and 33 mm.
    - The spectrum along the road is proportional to the power -2.2 of the spatial frequency, from
      1 to 20 1/m.

    The road is along x if `direction` is 0; rows of blocks lie across it.

    Examples
    --------
    >>> road = BelgianBlock(seed=3)
    >>> x = np.arange(0.0, 100.0, 0.05)
    >>> bool(15e-3 < road.height(x, 1.0).std() < 35e-3)
    True
    """

    row_pitch: float = 0.1725
    "Pitch of joints along the road [m]."
    row_scatter: float = 0.022
    "Maximum displacement of the joint before a row [m]."
    row_waviness: float = 0.016
    "Maximum meander of the joint before a row [m]."
    row_waviness_length: float = 0.5
    "Length over which a row meanders [m]."
    block_pitch: float = 0.196
    "Pitch of joints across the road [m]."
    block_scatter: float = 0.032
    "Maximum displacement of a joint between two blocks of a row [m]."
    block_slant: float = 0.12
    "Maximum slant of such a joint [m/m]."
    bond: float = 0.5
    "Displacement of every other row across the road, as a fraction of `block_pitch` [1]."
    bond_scatter: float = 0.35
    "Maximum further displacement of a row, as a fraction of `block_pitch` [1]."
    joint_width: float = 0.008
    "Width of the floor of a joint [m]."
    joint_depth: float = 0.0077
    "Mean depth of a joint below the adjacent tops [m]."
    joint_depth_scatter: float = 0.5
    "Standard deviation of that depth as a fraction of it [1]."
    shoulder: float = 0.028
    "Width of the rounded shoulder between the floor of a joint and a top [m]."
    crown: float = 0.0017
    "Height of the centre of a top above the midpoints of its edges [m]."
    height_scatter: float = 0.003
    "Standard deviation of the height of a block on its bed [m]."
    tilt_scatter: float = 0.031
    "Standard deviation of the tilt of a block, along and across [m/m]."
    lean: float = 0.036
    "Mean tilt of the blocks, rising along the road [m/m]."
    bedding: float = 0.7
    "Fraction of the slope of the bed that a block follows [1]."
    texture: float = 0.001
    "RMS of the roughness of the tops [m]."
    texture_length: float = 0.024
    "Length of its features [m]."
    field_height: float = 0.0245
    "Height of the high fields above the mean of the bed, depth of the low ones below it [m]."
    field_scatter: float = 0.007
    "Standard deviation of the height of a field [m]."
    field_length: float = 1.12
    "Mean length of a field along the road [m]."
    field_length_scatter: float = 0.2
    "Maximum displacement of the edge of a field, as a fraction of `field_length` [1]."
    field_width: float = 2.0
    "Width of a field across the road; two fields meet at y = 0 [m]."
    field_ramp: float = 0.3
    "Mean length of the ramp from field to field along the road [m]."
    field_ramp_scatter: float = 0.8
    "Maximum deviation of a ramp from that length, as a fraction of it [1]."
    lane_ramp: float = 0.6
    "Length of the ramp from field to field across the road [m]."
    undulation: float = 0.0065
    "RMS of the additional unevenness of the bed [m]."
    undulation_length: float = 0.7
    "Length of its features [m]."
    direction: float = 0.0
    "Direction of the road, counter-clockwise from east [rad]."
    seed: int = 0
    "Seed of all random numbers."

    def __post_init__(self) -> None:
        check_positive(self, *_POSITIVE)
        check_not_negative(self, *_NOT_NEGATIVE)
        check_fraction(self, *_FRACTIONS)
        check_finite(self, "bond", "crown", "lean", "field_height", "direction")
        check_seed(self.seed)
        half_joint = 0.5 * self.joint_width + self.shoulder
        row_displacement = self.row_scatter + self.row_waviness
        # extent of a row on either side of its centre line [m]
        half_row = 0.5 * self.row_pitch + row_displacement + half_joint
        block_displacement = self.block_scatter + self.block_slant * half_row
        _check_pitch("row_pitch", self.row_pitch, half_joint, row_displacement)
        _check_pitch("block_pitch", self.block_pitch, half_joint, block_displacement)
        longest = self.field_ramp * (1.0 + self.field_ramp_scatter)
        shortest = self.field_length * (1.0 - 2.0 * self.field_length_scatter)
        if not 0 <= self.field_length_scatter < 0.5 or longest > shortest:
            raise ValueError(
                "field_length_scatter must fit the longest ramp "
                f"of {longest:.4g} m on the shortest field, got {self.field_length_scatter}."
            )
        if self.lane_ramp > self.field_width:
            raise ValueError(
                f"lane_ramp must be at most field_width {self.field_width} m, "
                f"got {self.lane_ramp} m."
            )

    def _height(self, x: Floats, y: Floats) -> Floats:
        u, v = rotate_axes(x, y, self.direction)
        return np.asarray(_kernels.belgian_block(self.seed, self._paving, u, v))

    @cached_property
    def _paving(self) -> _kernels.Paving:
        names = _kernels.Paving._fields
        return _kernels.Paving(**{name: float(getattr(self, name)) for name in names})


def _check_pitch(name: str, pitch: float, half_joint: float, displacement: float) -> None:
    """Raise ValueError unless a top remains between two displaced joints."""
    minimum = 2.0 * (half_joint + displacement)
    if pitch < minimum:
        raise ValueError(
            f"{name} must be at least {minimum:.4g} m, to fit joints and their scatter, "
            f"got {pitch} m."
        )
