"""Numbers and values as text."""

import math
from collections.abc import Iterable
from typing import Any

#: What is not known.
UNKNOWN = "–"

_MINUS = "−"
_GAP = "\N{NARROW NO-BREAK SPACE}"
_SIGNIFICANT = 4  # digits of the largest number of a column
_MIN_SIGNIFICANT = 2  # digits of its smallest
_MAX_ADDED = 2  # decimals beyond those of the largest number, for the smallest
_MOST_DECIMALS = 9
_SMALL, _LARGE = 1e-6, 1e12  # limits of decimal notation
_GROUPED = 10_000  # numbers from which thousands are separated
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_BYTES = ("B", "kB", "MB", "GB", "TB")


def python_value(value: Any) -> Any:
    """A Python value for a scalar of numpy or xarray; NaN becomes None."""
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and math.isnan(value) else value


def is_number(value: Any) -> bool:
    """Whether a plain value is written as a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def column_decimals(values: Iterable[Any]) -> int | None:
    """Decimals for a column of plain values, so that its decimal points are aligned.

    They show four significant digits of the largest number and two of the smallest, less what is
    zero in all; None if these are so far apart that each number needs its own. Whole numbers stay
    whole and do not count.
    """
    known = [abs(value) for value in values if isinstance(value, float) and math.isfinite(value)]
    sizes = [value for value in known if value]
    if not sizes:
        return 0 if known else None
    wanted = (
        _significant_decimals(max(sizes), _SIGNIFICANT),
        _significant_decimals(min(sizes), _MIN_SIGNIFICANT),
    )
    if wanted[1] - wanted[0] > _MAX_ADDED:
        return None
    return max(_needed_decimals(value, max(wanted)) for value in sizes)


def format_value(value: Any, digits: int | None = None) -> str:
    """Text of a value: numbers with some decimals, text unchanged.

    Examples
    --------
    >>> [format_value(value) for value in (-0.12345, 1234, None, float("nan"), 2e-9)]
    ['−0.1235', '1234', '–', '–', '2.00 × 10⁻⁹']
    >>> format_value(1.0, 2)
    '1.00'
    """
    value = python_value(value)
    if value is None or value == "":
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not is_number(value):
        return str(value)
    if math.isinf(value):
        return "∞" if value > 0 else f"{_MINUS}∞"
    if digits is None:
        if value != 0 and not _SMALL <= abs(value) < _LARGE:
            mantissa, power = f"{value:.2e}".split("e")
            return f"{mantissa} × 10{str(int(power)).translate(_POWERS)}".replace("-", _MINUS)
        whole = isinstance(value, int) or value == 0
        digits = (
            0 if whole else _needed_decimals(value, _significant_decimals(abs(value), _SIGNIFICANT))
        )
    written = f"{abs(value):{',' if abs(value) >= _GROUPED else ''}.{digits}f}"
    sign = _MINUS if value < 0 and float(written.replace(",", "")) != 0 else ""
    return sign + written.replace(",", _GAP)


def format_size(number: int) -> str:
    """Size of a file.

    Examples
    --------
    >>> [format_size(number) for number in (999, 4_800_000, 12_345)]
    ['999 B', '4.8 MB', '12 kB']
    """
    power = min((len(str(number)) - 1) // 3, len(_BYTES) - 1)
    scaled = number / 1000**power
    return f"{scaled:.{0 if power == 0 or scaled >= 10 else 1}f} {_BYTES[power]}"


def _significant_decimals(size: float, significant: int) -> int:
    wanted = significant - 1 - math.floor(math.log10(size))
    return min(max(wanted, 0), _MOST_DECIMALS)


def _needed_decimals(value: float, digits: int) -> int:
    """Decimals without trailing zeros."""
    fraction = f"{value:.{digits}f}".partition(".")[2]
    return len(fraction.rstrip("0"))
