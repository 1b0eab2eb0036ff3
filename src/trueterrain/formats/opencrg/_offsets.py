"""Lateral offsets v of the long sections of an OpenCRG file.

Sections are named by position, or numbered from the right edge with equal spacing. The MATLAB
library and the C library complete a header that lacks lines differently; where that matters, it is
an error.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.formats.opencrg._header import LOST, CrgHeader

_COINCIDE = 1e-6  # [m] distance below which two long sections coincide


def section_offsets(header: CrgHeader) -> npt.NDArray[np.float64]:
    """Offset v of each long section [m], in the order of the columns."""
    kinds = {kind for kind, _ in header.sections}
    if len(header.sections) < 2 or len(kinds) != 1:
        found = "both kinds" if len(kinds) == 2 else f"{len(header.sections)}"
        raise FormatError(
            "must name at least 2 long sections, all by number or all by position, "
            f"but it names {found}",
            path=header.path,
            place="section $KD_DEFINITION",
            cure=LOST,
        )
    values = np.array([value for _, value in header.sections])
    right, left = (header.road.get(f"long_section_v_{side}") for side in ("right", "left"))
    if (right is None) != (left is None):
        raise FormatError(
            f"LONG_SECTION_V_{'RIGHT' if right is None else 'LEFT'} is missing, its partner is not",
            path=header.path,
            place="section $ROAD_CRG",
            cure=LOST,
        )
    if kinds == {"number"}:
        return _numbered_offsets(header, values, right, left)
    return _positioned_offsets(header, values, right, left)


def _numbered_offsets(
    header: CrgHeader, numbers: npt.NDArray[np.float64], right: float | None, left: float | None
) -> npt.NDArray[np.float64]:
    count = numbers.size
    if sorted(numbers) != list(range(1, count + 1)):
        raise FormatError(
            f"the numbers of the {count} long sections must be 1 to {count}",
            path=header.path,
            place="section $KD_DEFINITION",
            cure=LOST,
        )
    increment = header.road.get("long_section_v_increment")
    if increment is None or not increment > 0:
        raise FormatError(
            "LONG_SECTION_V_INCREMENT is missing, so the numbered long sections have no place",
            path=header.path,
            place="section $ROAD_CRG",
            cure=LOST,
        )
    if right is None or left is None:
        right = -increment * (count - 1) / 2
        header.problems.append(
            "LONG_SECTION_V_RIGHT and _LEFT are missing: taken as symmetric, as the MATLAB library "
            "does, but programs with the C library start at v = 0"
        )
    elif abs(right + increment * (count - 1) - left) > 0.01 * increment:
        raise FormatError(
            f"{count} long sections from {right:g} m to {left:g} m are not {increment:g} m apart",
            path=header.path,
            place="section $ROAD_CRG",
            cure="Correct the header, or export the file again.",
        )
    return right + increment * (numbers - 1)


def _positioned_offsets(
    header: CrgHeader, positions: npt.NDArray[np.float64], right: float | None, left: float | None
) -> npt.NDArray[np.float64]:
    ascending = np.sort(positions)
    if (np.diff(ascending) < _COINCIDE).any():
        at = ascending[1:][np.diff(ascending) < _COINCIDE][0]
        raise FormatError(
            f"two long sections lie at v = {at:g} m",
            path=header.path,
            place="section $KD_DEFINITION",
            cure=LOST,
        )
    if right is None or left is None:
        banked = any(header.road.get(f"reference_line_{end}_b") for end in ("start", "end"))
        if banked or "banking" in header.channels:
            raise FormatError(
                "LONG_SECTION_V_RIGHT and _LEFT are missing, and without them programs with the C "
                "library drop the banking",
                path=header.path,
                place="section $ROAD_CRG",
                cure=LOST,
            )
        header.problems.append("LONG_SECTION_V_RIGHT and _LEFT are missing")
    elif max(abs(ascending[0] - right), abs(ascending[-1] - left)) > 1e-3:
        raise FormatError(
            f"long sections from {ascending[0]:g} m to {ascending[-1]:g} m do not reach from "
            f"LONG_SECTION_V_RIGHT ({right:g} m) to _LEFT ({left:g} m)",
            path=header.path,
            place="section $ROAD_CRG",
            cure="Correct the header, or export the file again.",
        )
    return positions
