"""The command ``trueterrain filter``: low, high and band pass of profiles by wavelength."""

from pathlib import Path
from typing import Annotated, Literal

import xarray as xr
from cyclopts import Parameter

from trueterrain import formats
from trueterrain.cli._console import note_compilation, note_omissions, write_note
from trueterrain.cli._profiles import read_profile, write_warning
from trueterrain.core.errors import name_file_in_errors
from trueterrain.roughness import (
    FILTER_250_MM,
    Butterworth,
    Filter,
    MovingAverage,
    filter_profile,
)

Kind = Literal["butterworth", "moving-average", "250mm"]


def filter(  # noqa: A001 - the name of the command
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    kind: Kind = "butterworth",
    shortest: float | None = None,
    longest: float | None = None,
    order: int | None = None,
    force: bool = False,
) -> None:
    """Filter profiles by wavelength: low, high or band pass without phase shift.

    --shortest alone is a low pass, --longest alone a high pass, both together a band pass. A low
    pass leaves a constant grade unchanged, a high pass removes it. Each track is filtered
    separately; stations do not change.

    Example: trueterrain filter road.erd --shortest 8 --longest 90 -o band.erd

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet.
    output
        Profile to write: .erd, .csv, .parquet or .zarr.
    kind
        butterworth: half of the power at the given wavelengths, equal spacing only. moving-average:
        the mean over --shortest around each sample, or the profile less its mean over --longest; it
        passes half of the power of waves of 2.26 lengths. 250mm: the moving average over 0.25 m,
        without further options.
    shortest
        Waves shorter than this are removed [m]; none by default.
    longest
        Waves longer than this are removed [m]; none by default.
    order
        Order of the Butterworth filter in each direction, forward and backward; by default 3.
        Beyond the given wavelengths, waves decrease by 12 dB per octave and order.
    force
        Replace the output if it exists.
    """
    by = _chosen_filter(kind, shortest, longest, order)
    formats.writer_of("profile", output)
    formats.require_writable(output, force=force, inputs=[file], kind="profile")
    profile = read_profile(file)
    with name_file_in_errors(file), note_compilation():
        result = filter_profile(profile, by)
    _warn_of_window(file, profile, by)
    formats.write(result, output, force=force)
    _print_summary(result, by, output)
    _note_omissions(profile, result, output)


def _chosen_filter(
    kind: Kind, shortest: float | None, longest: float | None, order: int | None
) -> Filter:
    if order is not None and kind != "butterworth":
        message = f"--order is for --kind butterworth, got --kind {kind}."
        raise ValueError(message)
    if kind == "250mm":
        if shortest is not None or longest is not None:
            message = (
                "--kind 250mm is a moving average over 0.25 m, without --shortest and --longest; "
                "choose --kind moving-average for other lengths."
            )
            raise ValueError(message)
        return FILTER_250_MM
    if shortest is None and longest is None:
        message = "--shortest, --longest or both must be given: the waves to remove [m]."
        raise ValueError(message)
    if kind == "moving-average":
        return MovingAverage(shortest=shortest, longest=longest)
    if order is None:
        return Butterworth(shortest=shortest, longest=longest)
    return Butterworth(shortest=shortest, longest=longest, order=order)


def _warn_of_window(path: Path, profile: xr.Dataset, by: Filter) -> None:
    """Warn if a moving average has too few samples; a Butterworth filter raises an error."""
    s = profile["s"].values
    spacing = float(s[-1] - s[0]) / (s.size - 1)
    window = min(length for length in (by.shortest, by.longest) if length is not None)
    if window < 2 * spacing:
        write_warning(
            f"{path}: the window of {window:g} m averages little at a spacing of {spacing:.4g} m."
        )


def _print_summary(result: xr.Dataset, by: Filter, output: Path) -> None:
    tracks = result.sizes.get("track", 1)
    several = f" of {tracks} tracks" if tracks > 1 else ""
    s = result["s"].values
    ends = f"from {s[0]:g} to {s[-1]:g} m"
    write_note(f"{output}: {s.size:,} samples{several} {ends}, with {_passed_text(by)}")
    reach = _filter_reach(by)
    if 2 * reach < s[-1] - s[0]:
        beyond = "depend on the assumed profile beyond: its mirror image"
        write_note(f"{output}: heights within {reach:g} m of the ends {beyond}")
    else:
        write_warning(
            f"{output}: no height is farther than {reach:g} m from the ends, so all depend on the "
            "assumed profile beyond: its mirror image."
        )


def _passed_text(by: Filter) -> str:
    if by.longest is None:
        return f"waves longer than {by.shortest:g} m"
    if by.shortest is None:
        return f"waves shorter than {by.longest:g} m"
    return f"waves from {by.shortest:g} to {by.longest:g} m"


def _filter_reach(by: Filter) -> float:
    """Distance over which an end affects a filter [m]: half of its windows, or one wavelength."""
    lengths = by.shortest or 0.0, by.longest or 0.0
    return 0.5 * sum(lengths) if isinstance(by, MovingAverage) else max(lengths)


def _note_omissions(profile: xr.Dataset, result: xr.Dataset, output: Path) -> None:
    """Note the variables that are not in the output."""
    omitted = [str(name) for name in profile.data_vars if name not in result]
    if omitted:
        write_note(f"{output}: not kept, since the heights have changed: {', '.join(omitted)}")
    note_omissions(result, output)
