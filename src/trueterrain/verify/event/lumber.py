"""Cut list of an event: exact sizes of its pieces, and the lumber to saw them from."""

import math
from dataclasses import dataclass

from trueterrain.verify.event.layout import EventDesign

_INCH = 0.0254  # [m]
_FOOT = 0.3048  # [m]

# Nominal inches and dressed sizes in inches of dry softwood boards, as sold in North America
_THICKNESSES = {1: 0.75, 2: 1.5, 3: 2.5, 4: 3.5}
_WIDTHS = {2: 1.5, 3: 2.5, 4: 3.5, 6: 5.5, 8: 7.25, 10: 9.25, 12: 11.25}
_LENGTHS = (6, 8, 10, 12, 14, 16)  # feet
_SHEET = (2.44, 1.22)  # [m] plywood, 8 by 4 feet

_AS_SOLD = 0.0015  # [m] tolerance of lumber; a size within it needs no sawing
_DENSITY = 480.0  # [kg/m³] of dry softwood and plywood
_OVERHANG = 0.45  # [m] of cleats beyond the centre of each tyre, for lateral errors of steering
_SLACK = 1e-9  # [1] rounding when boards are counted


@dataclass(frozen=True, kw_only=True)
class EventPiece:
    """Equal pieces of an event."""

    name: str
    "Name."

    count: int
    "Number of pieces."

    length: float
    "Size across the direction of travel [m]."

    width: float
    "Size along the direction of travel [m]."

    thickness: float
    "Height [m]."

    stock: str
    "Lumber to saw them from, by its nominal size."

    stock_count: int
    "Number of boards or sheets."

    work: str
    "Sawing and planing that is needed."

    unsawn_width: float
    "Width of the nearest lumber as sold [m]."

    @property
    def mass(self) -> float:
        """Mass of one piece of softwood [kg]."""
        return _DENSITY * self.length * self.width * self.thickness


def cleat_span(design: EventDesign) -> float:
    """Length of a cleat that reaches under both wheels, with a margin for steering [m]."""
    return design.inputs.track + 2 * _OVERHANG


def cut_list(design: EventDesign) -> tuple[EventPiece, ...]:
    """Cut list: pieces of an event, with the lumber to saw them from.

    Parameters
    ----------
    design : EventDesign
        The event.

    Returns
    -------
    tuple of EventPiece
        Cleats, and boards below them if there are any.

    Raises
    ------
    ValueError
        If the cleats are higher than lumber is thick, 89 mm.

    Examples
    --------
    >>> from trueterrain.verify.event.design import EventInputs, design_event
    >>> for piece in cut_list(design_event(EventInputs(), model="thesis")):
    ...     print(f"{piece.count} of {1000 * piece.length:.0f} x {1000 * piece.width:.0f} x "
    ...           f"{1000 * piece.thickness:.0f} mm: {piece.stock_count} of {piece.stock}; "
    ...           f"{piece.work}")
    5 of 2500 x 170 x 38 mm: 5 of 2x8, 10 ft; rip from 184 mm
    """
    whole = cleat_span(design)
    halves = 1 if design.placement == "across" else 2
    sides = design.events * (2 if design.placement == "staggered" else 1)
    cleats = _cleat_piece(design, whole / halves, sides)
    if not design.base:
        return (cleats,)
    along, across = design.built_length, whole / halves
    sheets = math.ceil(along / _SHEET[0] - 0.05) * math.ceil(across / _SHEET[1] - 0.05)
    boards = EventPiece(
        name="board under the cleats",
        count=sides,
        length=across,
        width=along,
        thickness=design.base,
        stock=f"plywood {1000 * design.base:.0f} mm, {_SHEET[0]} x {_SHEET[1]} m",
        stock_count=sides * sheets,
        work="join sheets flush",
        unsawn_width=along,
    )
    return cleats, boards


def _cleat_piece(design: EventDesign, length: float, sides: int) -> EventPiece:
    thick = [
        (nominal, inches * _INCH)
        for nominal, inches in _THICKNESSES.items()
        if inches * _INCH > design.rise - _AS_SOLD
    ]
    if not thick:
        message = f"rise must be at most 89 mm for lumber, got {1000 * design.rise:g} mm."
        raise ValueError(message)
    nominal, thickness = thick[0]
    widths = {name: inches * _INCH for name, inches in _WIDTHS.items() if name >= nominal}
    abreast = math.ceil(design.width / (max(widths.values()) + _AS_SOLD))
    part = design.width / abreast
    board = min(name for name, width in widths.items() if width > part - _AS_SOLD)
    nearest = min(widths.values(), key=lambda width: abs(width - part))
    work = [] if widths[board] - part < _AS_SOLD else [f"rip from {1000 * widths[board]:.0f} mm"]
    if thickness - design.rise > _AS_SOLD:
        work.append(f"plane from {1000 * thickness:.0f} mm")
    if abreast > 1:
        work.append(f"{abreast} abreast make a cleat")
    count = sides * design.number
    feet, boards = _count_boards(count * abreast, length)
    return EventPiece(
        name="cleat",
        count=count,
        length=length,
        width=design.width,
        thickness=design.rise,
        stock=f"{nominal}x{board}, {feet} ft",
        stock_count=boards,
        work=", ".join(work) or "as sold",
        unsawn_width=nearest * abreast,
    )


def _count_boards(pieces: int, length: float) -> tuple[int, int]:
    """Length in feet and number of boards with the least waste."""
    choices = []
    for feet in _LENGTHS:
        each = math.floor(feet * _FOOT / length + _SLACK)
        if each:
            boards = math.ceil(pieces / each)
            choices.append((round(boards * feet, 6), feet, boards))
    if not choices:  # pieces longer than any board: boards end to end
        longest = _LENGTHS[-1]
        return longest, pieces * math.ceil(length / (longest * _FOOT))
    _, feet, boards = min(choices)
    return feet, boards
