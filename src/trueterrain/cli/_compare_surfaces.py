"""Comparison of surfaces for ``trueterrain compare``: document, tables and pictures."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from trueterrain.cli._compare_profiles import bind_panel, format_millimetres
from trueterrain.cli._console import write_line
from trueterrain.cli._profiles import write_table
from trueterrain.surface.difference import (
    HeightDifferences,
    difference_statistics,
    structure_function,
    surface_difference,
)

_NUMBERS = ("mean", "median", "rms", "nmad", "p95", "largest")
_AXES: tuple[Literal["along", "across"], ...] = ("along", "across")
_PRINTED = (0.1, 1.0, 10.0, 100.0)  # [m] distances for which the structure function is printed


@dataclass(frozen=True, kw_only=True)
class DifferenceRow:
    """Difference statistics of one surface or several pooled, for one lane or the full width."""

    surface: str | None
    "Name of the surface; None for several pooled."

    reference: str | None
    "Name of the reference."

    lane: tuple[float, float] | None
    "Right and left edge of the lane [m]; None for the whole surface."

    speed: float | None
    "Speed of the measurement [km/h]; None if unknown."

    found: HeightDifferences
    "Statistics of the difference."


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceComparison:
    """Differences of surfaces with their statistics and structure functions."""

    differences: dict[tuple[str, str], xr.Dataset]
    "Differences by names of the surface and of its reference."

    rows: list[DifferenceRow]
    "Statistics of each surface, as a whole and by lane."

    by_speed: list[DifferenceRow]
    "Statistics of all surfaces of the same speed, pooled."

    structure: dict[tuple[str, str, str], xr.Dataset]
    "Structure functions by surface, reference and axis."

    left_out: list[str]
    "Comparisons that were not made, and why."

    @classmethod
    def of(
        cls,
        data: Mapping[str, xr.Dataset],
        reference: str | None,
        *,
        level: Literal["none", "median", "plane"],
        lanes: list[float] | None,
        speed: list[float] | None,
    ) -> "SurfaceComparison":
        """Compare surfaces."""
        speeds = _speeds_by_name([name for name in data if name != reference], speed, reference)
        bands = _lane_bands(lanes)
        differences = {
            (name, base): surface_difference(data[name], data[base], level=level)
            for name, base in _surface_pairs(list(data), reference)
        }
        return cls(
            differences=differences,
            rows=list(_difference_rows(differences, bands, speeds)),
            by_speed=list(_pooled_rows(differences, bands, speeds)),
            structure={
                (*pair, axis): structure_function(difference, axis=axis)
                for pair, difference in differences.items()
                for axis in _AXES
            },
            left_out=[
                *([] if lanes else ["by lane: no edges of lanes are given (--lanes)"]),
                *([] if speeds else ["by speed: no speeds are given (--speed)"]),
            ],
        )

    def document(self) -> dict[str, Any]:
        """JSON document."""
        return {
            "kind": "surfaces",
            "differences": [_as_dict(row) for row in self.rows],
            "by_speed": [_as_dict(row) for row in self.by_speed],
            "structure": [
                {"surface": surface, "reference": reference, "axis": axis}
                | {"distance": one["distance"].values.tolist()}
                | {"structure": one["structure"].values.tolist()}
                | {"pairs": one["pairs"].values.tolist()}
                for (surface, reference, axis), one in self.structure.items()
            ],
            "left_out": self.left_out,
        }

    def show(self) -> None:
        """Print tables."""
        write_line("Height of each surface less that of its reference [mm]")
        write_table(list(_table_rows(self.rows)))
        if self.by_speed:
            write_line()
            write_line("All surfaces of the same speed, pooled [mm]")
            write_table(list(_table_rows(self.by_speed)))
        write_line()
        write_line(
            "Root of the structure function: RMS change of the difference over a distance [mm]"
        )
        write_table(list(_structure_rows(self.structure)))
        for text in self.left_out:
            write_line(f"Not compared {text}.")

    def panels(self) -> tuple[list[str], list[list[Callable[[Any], object]]]]:
        """Titles and panels of the picture: a map of each difference, and structure functions."""
        from trueterrain import figures

        titles, panels = [], []
        for (name, base), difference in self.differences.items():
            functions = {axis: self.structure[name, base, axis] for axis in _AXES}
            column: list[Callable[[Any], object]] = [bind_panel(figures.difference_map, difference)]
            if any(float(one["structure"].max()) > 0 for one in functions.values()):
                column.append(bind_panel(figures.structure_functions, functions))
            titles.append(f"{name} less {base}")
            panels.append(column)
        return titles, panels


def _surface_pairs(names: list[str], reference: str | None) -> list[tuple[str, str]]:
    """Pairs of a surface and its reference."""
    if reference is not None:
        return [(name, reference) for name in names if name != reference]
    return [(second, first) for first, second in itertools.combinations(names, 2)]


def _speeds_by_name(
    names: list[str], speed: list[float] | None, reference: str | None
) -> dict[str, float]:
    if not speed:
        return {}
    if reference is None:
        message = "--speed needs --reference: without it a difference has two speeds."
        raise ValueError(message)
    if len(speed) != len(names):
        message = f"--speed must name one speed for each of {len(names)} surfaces, got {len(speed)}"
        raise ValueError(message)
    return dict(zip(names, speed, strict=True))


def _lane_bands(lanes: list[float] | None) -> list[tuple[float, float]]:
    if not lanes:
        return []
    if len(lanes) < 2 or sorted(set(lanes)) != lanes:
        listed = " ".join(f"{edge:g}" for edge in lanes)
        message = f"--lanes must be two or more edges from right to left, ascending, got {listed}"
        raise ValueError(message)
    return list(itertools.pairwise(lanes))


def _difference_rows(
    differences: Mapping[tuple[str, str], xr.Dataset],
    bands: list[tuple[float, float]],
    speeds: Mapping[str, float],
) -> Iterator[DifferenceRow]:

    for (name, base), difference in differences.items():
        for lane in (None, *bands):
            found = difference_statistics(difference, across=lane)
            speed = speeds.get(name)
            yield DifferenceRow(surface=name, reference=base, lane=lane, speed=speed, found=found)


def _pooled_rows(
    differences: Mapping[tuple[str, str], xr.Dataset],
    bands: list[tuple[float, float]],
    speeds: Mapping[str, float],
) -> Iterator[DifferenceRow]:

    for speed in sorted(set(speeds.values())):
        several = [one for (name, _), one in differences.items() if speeds[name] == speed]
        base = next(base for _, base in differences)
        for lane in (None, *bands):
            found = difference_statistics(several, across=lane)
            yield DifferenceRow(surface=None, reference=base, lane=lane, speed=speed, found=found)


def _as_dict(row: DifferenceRow) -> dict[str, Any]:
    lane = None if row.lane is None else list(row.lane)
    named = {"surface": row.surface, "reference": row.reference, "lane": lane, "speed": row.speed}
    return named | asdict(row.found)


def _table_rows(rows: list[DifferenceRow]) -> Iterator[list[str]]:
    lanes = any(row.lane is not None for row in rows)
    speeds = any(row.speed is not None for row in rows)
    single = any(row.surface is not None for row in rows)
    yield [
        *(["surface", "reference"] if single else []),
        *(["speed [km/h]"] if speeds else []),
        *(["lane [m]"] if lanes else []),
        "nodes",
        "mean",
        "median",
        "RMS",
        "NMAD",
        "95 %",
        "largest",
    ]
    for row in rows:
        lane = "all" if row.lane is None else f"{row.lane[0]:g} to {row.lane[1]:g}"
        yield [
            *([str(row.surface), str(row.reference)] if single else []),
            *([f"{row.speed:g}"] if speeds else []),
            *([lane] if lanes else []),
            f"{row.found.n:,}",
            *(format_millimetres(getattr(row.found, name)) for name in _NUMBERS),
        ]


def _structure_rows(structure: Mapping[tuple[str, str, str], xr.Dataset]) -> Iterator[list[str]]:
    """Structure functions at the printed distances; a dash beyond their range."""
    yield ["surface", "reference", "axis", *(f"{distance:g} m" for distance in _PRINTED)]
    for (surface, reference, axis), one in structure.items():
        distances = one["distance"].values
        texts = []
        for distance in _PRINTED:
            known = (
                distances.size > 0
                and distances[0] <= 1.01 * distance
                and distance <= 1.01 * distances[-1]
            )
            value = np.interp(distance, distances, one["structure"].values) if known else 0.0
            texts.append(format_millimetres(value**0.5) if known else "-")
        yield [surface, reference, axis, *texts]
