"""What makes a comparison flagged: units, lengths, a search that ends at its limit."""

from collections.abc import Iterator

import numpy as np

from trueterrain.roughness.agreement._pair import RegisteredPair
from trueterrain.roughness.agreement._signal import ProfileTrack
from trueterrain.roughness.agreement.options import AgreementSettings

# ratios that a wrong unit leaves
_UNITS = {
    "feet": 1 / 0.3048,
    "inches": 1 / 0.0254,
    "millimetres": 1000.0,
    "centimetres": 100.0,
}

_NEAR = 0.03  # share by which a ratio may miss that of two units
_ALIKE = 0.7  # correlation from which on a ratio of amplitudes is no chance
_UNLIKE = 0.01  # share by which lengths may differ without a word
_AT_LIMIT = 0.02  # share of a search range that counts as its end


def pair_flags(
    first: ProfileTrack, second: ProfileTrack, pair: RegisteredPair, options: AgreementSettings
) -> Iterator[str]:
    """What is flagged about two tracks beside each other."""
    like, shift, scale = pair.plain, pair.shift, pair.scale
    both = f"{first.name} and {second.name}"
    unit = _suspected_unit(second.length / first.length)
    longer, shorter = (second, first) if second.length > first.length else (first, second)
    lengths = f"{longer.name} is {longer.length:g} m long, {shorter.name} {shorter.length:g} m"
    if unit:
        yield f"{lengths}: are the stations of {longer.name} in {unit}?"
    elif longer.length - shorter.length > max(_UNLIKE * longer.length, options.max_shift):
        yield f"{lengths}: only the {like.overlap:.4g} m that they share are compared"
    if abs(like.correlation) > _ALIKE and (unit := _suspected_unit(like.sd_ratio)):
        taller, lower = (second, first) if like.sd_ratio > 1 else (first, second)
        ratio = max(like.sd_ratio, 1 / like.sd_ratio)
        yield (
            f"{taller.name} is {ratio:.4g} times as high as {lower.name}: "
            f"are its heights in {unit}?"
        )
    if pair.rival is not None:
        yield (
            f"{both}: a shift of {pair.rival:.3f} m is rated nearly as well as {shift:.3f} m: "
            "the road repeats itself; allow less, or set the stations right"
        )
    if options.max_shift > 0 and abs(shift) >= (1 - _AT_LIMIT) * options.max_shift:
        yield f"{both}: the best shift, {shift:.3f} m, is at the end of the search; allow more"
    if options.max_scale > 0 and abs(scale) >= (1 - _AT_LIMIT) * options.max_scale:
        yield f"{both}: the best scale, {scale:.3%}, is at the end of the search; allow more"


def _suspected_unit(ratio: float) -> str:
    """Unit that was taken for metres, if a ratio looks like it."""
    ratio = max(ratio, 1 / ratio) if ratio > 0 else np.inf
    for name, factor in _UNITS.items():
        if abs(ratio / factor - 1) < _NEAR:
            return name
    return ""
