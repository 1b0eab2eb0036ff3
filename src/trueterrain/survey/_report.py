"""The report of a survey: surfaces, agreement, accuracy, profiles, motion, input."""

from collections.abc import Iterator
from typing import Any

from trueterrain.alignment.merge import MergeResult
from trueterrain.report import (
    Block,
    Column,
    File,
    Files,
    Number,
    Picture,
    Report,
    Section,
    SurfaceView,
    Table,
    Text,
    Warnings,
)
from trueterrain.survey._pictures import Pictures
from trueterrain.survey._products import SurfaceResult
from trueterrain.survey._report_merge import merge_headline, merge_section
from trueterrain.survey._report_parts import parse_columns, to_millimetres
from trueterrain.survey._settings import Survey


def report_of(
    survey: Survey,
    lanes: list[SurfaceResult],
    numbers: dict[str, Any],
    pictures: Pictures,
    files: list[tuple[str, str]],
    merging: MergeResult | None = None,
) -> Report:
    """Report of a survey.

    Parameters
    ----------
    survey : Survey
        Its settings.
    lanes : list of SurfaceResult
        Its surfaces.
    numbers : dict
        Contents of result.json.
    pictures : Pictures
        Figures that were drawn.
    files : list of tuple of str
        Names of the files, and their contents in words.
    merging : MergeResult, optional
        Alignment of the passes, if there was one.

    Returns
    -------
    Report
        To be written.
    """
    problems = [f"{lane.name}: {problem}" for lane in lanes for problem in lane.numbers["problems"]]
    sections = [
        Section(title="What is flagged", blocks=[Warnings(items=problems)]) if problems else None,
        _ground_section(lanes, pictures),
        merge_section(merging, pictures) if merging else None,
        _accuracy_section(numbers),
        _against_truth(lanes),
        _profile_section(survey, lanes, pictures),
        _motion_section(survey, numbers["runs"], pictures),
        _input_section(numbers),
        _file_section(files),
    ]
    return Report(
        title=survey.title or survey.name,
        subtitle=f"Survey {survey.name}: " + _count_text(len(numbers["runs"]), "recorded run"),
        headline=tuple(_headline_numbers(lanes, numbers, merging)),
        sections=tuple(section for section in sections if section is not None),
        provenance={lane.name: lane.steps for lane in lanes},
    )


def _headline_numbers(
    lanes: list[SurfaceResult], numbers: dict[str, Any], merging: MergeResult | None
) -> Iterator[Number]:
    each = numbers["lanes"]
    yield Number(
        label="Driven",
        value=sum(run["driven"] for run in numbers["runs"]),
        unit="m",
        digits=0,
        note=_count_text(len(numbers["runs"]), "run"),
    )
    yield Number(
        label="Returns gridded",
        value=sum(lane["returns"]["used"] for lane in each) / 1e6,
        unit="million",
        digits=2,
    )
    for name, label in (
        ("sd", "Standard deviation of a height"),
        ("sd_relative", "The same, relative to the datum of the passes"),
    ):
        sds = [lane["surface"][name]["median"] for lane in each]
        if known := [sd for sd in sds if sd is not None]:
            yield Number(
                label=label,
                value=1000 * max(known),
                unit="mm",
                digits=2,
                note="median over the nodes" + _worst_text(len(lanes)),
            )
    if merging is not None:
        yield from merge_headline(merging)
    for compared in numbers["agreement"][:1]:
        yield Number(
            label="Difference where surfaces overlap",
            value=1000 * compared["median"],
            unit="mm",
            digits=1,
            note=f"median of {' and '.join(compared['lanes'])}",
        )
    truths = [lane["truth"]["surface"] for lane in each if lane["truth"]]
    if truths:
        yield Number(
            label="Error of heights about their median",
            value=1000 * max(truth["nmad"] for truth in truths),
            unit="mm",
            digits=2,
            note="NMAD against the true ground" + _worst_text(len(lanes)),
        )
    yield from _roughness_numbers(each)


def _roughness_numbers(lanes: list[dict[str, Any]]) -> Iterator[Number]:
    """MRI of each pair of wheel paths; without any, the IRI of each profile."""
    several = len(lanes) > 1
    pairs = [(lane["name"], pair) for lane in lanes for pair in lane["wheel_paths"]]
    for lane, pair in pairs:
        yield Number(
            label="MRI",
            value=pair["mri"],
            unit="m/km",
            digits=2,
            note=f"wheel paths {pair['left']} and {pair['right']}" + f" of {lane}" * several,
        )
    if pairs:
        return
    for lane in lanes:
        for profile in lane["profiles"]:
            if profile["iri"] is not None:
                note = f"profile {profile['name']}" + f" of {lane['name']}" * several
                yield Number(label="IRI", value=profile["iri"], unit="m/km", digits=2, note=note)


def _ground_section(lanes: list[SurfaceResult], pictures: Pictures) -> Section:
    rows = [
        (
            lane.name,
            lane.numbers["surface"]["nodes"],
            " × ".join(f"{step:g} m" for step in lane.numbers["surface"]["spacing"].values()),
            lane.numbers["surface"]["count"]["median"],
            *(to_millimetres(lane.numbers["surface"]["sd"][name]) for name in ("median", "p95")),
            to_millimetres(lane.numbers["surface"]["sd_relative"]["median"]),
            lane.numbers["surface"]["holes"]["filled_nodes"],
            lane.numbers["surface"]["holes"]["open_nodes"],
        )
        for lane in lanes
    ]
    table = Table(
        columns=parse_columns(
            "Surface; Nodes; Spacing; Returns per node .0; sd, median [mm] .3; sd, 95 % [mm] .3; "
            "sd relative, median [mm] .3; Filled nodes; Open nodes"
        ),
        rows=rows,
        caption="Surfaces. The standard deviation of a height is absolute: it includes the noise "
        "of the ranges, the scatter of the returns in a cell and the uncertainty of the motion. "
        "For aligned passes the relative one leaves out their common datum: it is the uncertainty "
        "of heights within the surface.",
    )
    blocks: list[Block] = [table]
    for lane in lanes:
        blocks += [
            Picture(
                figure=pictures.figures[lane.name, "surface"],
                alt=f"Heights of the surface of {lane.name}, seen from above",
                caption=f"Surface of {lane.name}.",
            ),
            SurfaceView(
                surface=pictures.parts[lane.name],
                caption=f"A part from the centre of {lane.name}.",
            ),
        ]
    return Section(title="The ground", blocks=blocks)


def _accuracy_section(numbers: dict[str, Any]) -> Section:
    rows = [
        (
            run["name"],
            run["motion"]["method"],
            *(to_millimetres(run["motion"]["sd"][axis]) for axis in ("east", "north", "up")),
            *(
                _to_milliradians(run["motion"]["sd"][axis])
                for axis in ("about_east", "about_north", "about_up")
            ),
        )
        for run in numbers["runs"]
    ]
    motion = Table(
        columns=parse_columns(
            "Run; Method; East [mm] .1; North [mm] .1; Up [mm] .1; About east [mrad] .3; "
            "About north [mrad] .3; About up [mrad] .3"
        ),
        rows=rows,
        caption="Standard deviation of the pose of the body, median over time.",
    )
    blocks: list[Block] = [motion]
    if numbers["agreement"]:
        blocks.append(
            Table(
                columns=parse_columns(
                    "Surfaces; Nodes in common; Median [mm] .2; NMAD [mm] .2; RMSE [mm] .2; "
                    "95 % [mm] .2"
                ),
                rows=[
                    (
                        " - ".join(reversed(one["lanes"])),
                        one["n"],
                        *(to_millimetres(one[name]) for name in ("median", "nmad", "rmse", "p95")),
                    )
                    for one in numbers["agreement"]
                ],
                caption="Differences of height where surfaces overlap, as measured: the passes "
                "were not aligned.",
            )
        )
    elif len(numbers["lanes"]) > 1 and not numbers["merge"]:
        blocks.append(Text(paragraph="The surfaces do not overlap, so they cannot be compared."))
    elif len(numbers["runs"]) == 1:
        blocks.append(
            Text(
                paragraph="One pass does not show the drift of its navigation; its standard "
                "deviation is computed from that reported by the navigation. A second pass over "
                "the same ground would show the drift."
            )
        )
    return Section(title="Accuracy", blocks=blocks)


def _against_truth(lanes: list[SurfaceResult]) -> Section | None:
    if any(lane.numbers["truth"] is None for lane in lanes):
        return None
    heights = Table(
        columns=parse_columns(
            "Surface; Nodes; Median [mm] .2; NMAD [mm] .2; RMS about the median [mm] .2; "
            "95 % [mm] .2"
        ),
        rows=[
            (
                lane.name,
                truth["nodes"],
                to_millimetres(truth["median"]),
                to_millimetres(truth["nmad"]),
                to_millimetres(truth["rms_about_median"]),
                to_millimetres(truth["p95"]),
            )
            for lane in lanes
            for truth in [lane.numbers["truth"]["surface"]]
        ],
        caption="Heights less the true ground at the node. The median is the effect of the "
        "drift of navigation. The RMS includes joints and edges, where the mean of a cell differs "
        "from the height at its centre; the NMAD does not.",
    )
    rated = [
        (lane.name, profile["name"], profile["iri"], lane.numbers["truth"]["iri"][profile["name"]])
        for lane in lanes
        for profile in lane.numbers["profiles"]
        if profile["iri"] is not None
    ]
    blocks: list[Block] = [heights]
    if rated:
        blocks.append(
            Table(
                columns=parse_columns(
                    "Surface; Profile; IRI measured [m/km] .3; IRI of the true ground [m/km] .3; "
                    "Difference [%] .2"
                ),
                rows=[(*row, 100 * (row[2] / row[3] - 1)) for row in rated],
                caption="Roughness, and that of the true ground along the same paths.",
            )
        )
    return Section(title="Against the true ground", blocks=blocks)


def _profile_section(
    survey: Survey, lanes: list[SurfaceResult], pictures: Pictures
) -> Section | None:
    rows = [
        (
            lane.name,
            profile["name"],
            profile["length"],
            to_millimetres(profile["sd_median"]),
            profile["iri"],
        )
        for lane in lanes
        for profile in lane.numbers["profiles"]
    ]
    if not rows:
        return None
    blocks: list[Block] = [
        Table(
            columns=parse_columns(
                "Surface; Profile; Length [m] .2; sd, median [mm] .3; IRI [m/km] .2"
            ),
            rows=rows,
            caption="Profiles as a tyre feels them, and their International Roughness Index. Their "
            "standard deviation is that of the statistic of the heights under the tyre.",
        )
    ]
    both = [
        (lane.name, *(pair[name] for name in ("left", "right", "mri", "hri")))
        for lane in lanes
        for pair in lane.numbers["wheel_paths"]
    ]
    if both:
        blocks.append(
            Table(
                columns=parse_columns("Surface; Left; Right; MRI [m/km] .2; HRI [m/km] .2"),
                rows=both,
                caption="Mean and half-car roughness index of two wheel paths: profiles whose "
                "names differ only in left and right at the end. The second needs paths of equal "
                "length.",
            )
        )
    segments = [
        (lane.name, profile["name"], one["start"], one["end"], one["iri"])
        for lane in lanes
        for profile in lane.numbers["profiles"]
        for one in profile["segments"]
    ]
    if len(segments) > len(rows):
        blocks.append(
            Table(
                columns=parse_columns("Surface; Profile; From [m] .1; To [m] .1; IRI [m/km] .2"),
                rows=segments,
                caption=f"Segments of {survey.roughness.segment:g} m.",
            )
        )
    blocks += [
        Picture(
            figure=pictures.figures[lane.name, "profiles"],
            alt=f"Heights of the profiles of {lane.name} along their paths",
            caption=f"Profiles of {lane.name}"
            + (", the first of them." if len(lane.profiles) > 3 else "."),
        )
        for lane in lanes
        if lane.profiles
    ]
    return Section(title="Profiles and roughness", blocks=blocks)


def _motion_section(survey: Survey, runs: list[dict[str, Any]], pictures: Pictures) -> Section:
    blocks: list[Block] = [
        Picture(
            figure=pictures.figures[run["name"], "motion"],
            alt=f"Heave, pitch and roll of the body over time in {run['name']}",
            caption=f"Motion of the body in {run['name']}, which was removed from the heights.",
        )
        for run in runs
    ]
    noise = [
        (run["name"], _noise_values(run["motion"]["noise"]))
        for run in runs
        if run["motion"]["noise"]
    ]
    if noise:
        columns = (Column(label="Run"), *(Column(label=label) for label in noise[0][1]))
        blocks.append(
            Table(
                columns=columns,
                rows=[(name, *values.values()) for name, values in noise],
                caption="Noise of the instruments as it was used: measured in the run unless the "
                "settings give it.",
            )
        )
    text = f"Estimated from navigation and accelerometers by the method {survey.motion.method}."
    return Section(title="Motion", text=text, blocks=blocks)


def _noise_values(noise: dict[str, Any]) -> dict[str, str]:
    """Values in words, since their units differ."""
    found = {}
    for name, value in noise.items():
        parts = value if isinstance(value, list | tuple) else [value]
        words = [f"{part:.3g}" if isinstance(part, float) else str(part) for part in parts]
        found[name.replace("_", " ")] = ", ".join(words)
    return found


def _input_section(numbers: dict[str, Any]) -> Section:
    runs = Table(
        columns=parse_columns("Run; Store; Scans; Beams; Time [s] .1; Driven [m] .1"),
        rows=[
            tuple(run[key] for key in ("name", "path", "scans", "beams", "seconds", "driven"))
            for run in numbers["runs"]
        ],
        caption="Recorded runs.",
    )
    returns = Table(
        columns=parse_columns(
            "Surface; Returns gridded; Outside the grid; Flagged; Scans left out"
        ),
        rows=[
            (
                lane["name"],
                *(
                    lane["returns"][key]
                    for key in ("used", "outside", "flagged", "scans_uncovered")
                ),
            )
            for lane in numbers["lanes"]
        ],
        caption="Returns of the runs by outcome.",
    )
    longitude, latitude, height = numbers["runs"][0]["origin"]
    text = (
        f"Coordinates are east, north and up of {latitude:.7f} deg north, {longitude:.7f} deg "
        f"east, {height:.3f} m above the ellipsoid."
    )
    return Section(title="Input", text=text, blocks=[runs, returns])


def _file_section(files: list[tuple[str, str]]) -> Section:
    listed = [File(path=name, note=note) for name, note in files]
    listed.append(File(path="result.json", note="all numbers of this report"))
    return Section(title="Files", blocks=[Files(files=listed)])


def _to_milliradians(radians: float | None) -> float | None:
    return None if radians is None else 1000.0 * radians


def _count_text(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _worst_text(lanes: int) -> str:
    return ", worst surface" if lanes > 1 else ""
