"""Section of a report on the alignment of passes."""

from collections.abc import Iterator

from trueterrain.alignment.adjustment.network import Adjustment
from trueterrain.alignment.merge import MergeResult
from trueterrain.report import Block, Number, Picture, Section, Table, Text
from trueterrain.survey._pictures import Pictures
from trueterrain.survey._report_parts import parse_columns, to_millimetres

_METHODS = {
    "network": "One least-squares adjustment of all passes gave each a correction that varies "
    "with time; its stiffness was chosen by cross-validation with ground that was held out.",
    "discontinuity": "Discontinuity vectors along reference paths through the overlaps were "
    "low-pass filtered and subtracted from the passes, pair by pair (thesis, section 4.3.1).",
    "grid": "Nothing was corrected: the ground is the mean of all passes (thesis, section 4.3.2).",
}

#: Kinds of pictures, in the order of the report, with what they show.
_PICTURES = {
    "correction": "Corrections of the passes with their standard deviation, and the standard "
    "deviation that navigation reports.",
    "vectors": "Discontinuity vectors, raw and filtered.",
    "histograms": "Heights of both lanes at a reference point.",
    "seam": "Steps at the edges of the overlap, before and after.",
    "before": "Differences between the passes as measured.",
    "after": "Differences between the passes after the adjustment, in the same colours.",
    "choice": "Stiffness of the corrections: residuals in ground that was held out.",
    "spectrum": "Spectrum of the corrections.",
}


def merge_headline(merging: MergeResult) -> Iterator[Number]:
    """Headline numbers of an alignment.

    Parameters
    ----------
    merging : MergeResult
        The alignment.

    Yields
    ------
    Number
        Seam and differences.
    """
    worst = max(merging.pairs, key=lambda pair: pair.before.rmse, default=None)
    if worst is not None:
        yield Number(
            label="Passes apart, before",
            value=to_millimetres(worst.before.rmse),
            unit="mm",
            digits=1,
            note=f"RMSE of {worst.first} and {worst.second}",
        )
        yield Number(
            label="Passes apart, after",
            value=to_millimetres(worst.after.rmse),
            unit="mm",
            digits=2,
            note=f"RMSE of {worst.first} and {worst.second}",
        )
    seams = [seam for seam in merging.seams if seam.after.median == seam.after.median]
    if seams:
        worst_seam = max(seams, key=lambda seam: seam.after.median)
        yield Number(
            label="Seam",
            value=to_millimetres(worst_seam.after.median),
            unit="mm",
            digits=2,
            note=f"{1000 * worst_seam.before.median:.1f} mm before",
        )


def merge_section(merging: MergeResult, pictures: Pictures) -> Section:
    """Section on the agreement of the passes before and after.

    Parameters
    ----------
    merging : MergeResult
        The alignment.
    pictures : Pictures
        Figures that were drawn.

    Returns
    -------
    Section
        With tables and pictures.
    """
    blocks: list[Block] = [_pair_table(merging)]
    blocks += [*_seam_blocks(merging), *_network_blocks(merging)]
    blocks += [
        Picture(figure=figure, alt=text, caption=text)
        for start, text in _PICTURES.items()
        for (lane, kind), figure in pictures.figures.items()
        if lane == "merge" and kind.partition("-")[0] == start
    ]
    return Section(title="How the passes agree", text=_METHODS[merging.method], blocks=blocks)


def _pair_table(merging: MergeResult) -> Table:
    return Table(
        columns=parse_columns(
            "Passes; Cells; Median before [mm] .2; after [mm] .2; NMAD before [mm] .2; "
            "after [mm] .2; RMSE before [mm] .2; after [mm] .2; held out [mm] .2; "
            "95 % before [mm] .2; after [mm] .2; Rejected"
        ),
        rows=[
            (
                f"{pair.second} - {pair.first}",
                pair.before.n,
                *(
                    to_millimetres(getattr(state, name))
                    for name in ("median", "nmad")
                    for state in (pair.before, pair.after)
                ),
                *(to_millimetres(state.rmse) for state in (pair.before, pair.after, pair.held_out)),
                *(to_millimetres(state.p95) for state in (pair.before, pair.after)),
                pair.rejected,
            )
            for pair in merging.pairs
        ],
        caption="Differences of height in the cells that both passes saw. Held out: in cells "
        "that were left out of the adjustment. Rejected cells changed between the passes.",
    )


def _seam_blocks(merging: MergeResult) -> Iterator[Block]:
    if merging.seams:
        yield Table(
            columns=parse_columns("Passes; Seam before [mm] .2; after [mm] .2"),
            rows=[
                (
                    " - ".join(seam.names),
                    to_millimetres(seam.before.median),
                    to_millimetres(seam.after.median),
                )
                for seam in merging.seams
            ],
            caption="Steps of the merged ground where one pass ends inside another: median of "
            "their size along both edges of the overlap.",
        )


def describe_datum(found: Adjustment) -> str:
    """Uncertainty of the height error that all passes have in common, in words.

    Parameters
    ----------
    found : Adjustment
        The network adjustment.

    Returns
    -------
    str
        One sentence.
    """
    known = [sd for sd in found.datum_sd.values() if sd is not None]
    if len(known) < len(found.datum_sd):
        return (
            "The height error common to all passes is not known, since no navigation reports its "
            "standard deviation: relative standard deviations leave it out, and absolute ones "
            "exist only where points have their own (datum_sd sets it)."
        )
    return (
        f"The height error common to all passes has a standard deviation of "
        f"{1000 * max(known):.3g} mm."
    )


def _network_blocks(merging: MergeResult) -> Iterator[Block]:
    found = merging.adjustment
    if found is None:
        return
    chosen = found.chosen
    words = (
        f"Corrections of {', '.join(chosen.components)} have knots every {chosen.knot_spacing:g} s "
        f"and vary by {1000 * chosen.strength:.3g} mm (standard deviation) as a Gauss-Markov "
        f"process of {chosen.order} order: of {len(found.trials)} models, this is the "
        f"stiffest that predicts held-out ground as well as the best, to "
        f"{1000 * chosen.held_out:.3g} mm."
    )
    if found.omitted:
        words += f" {', '.join(found.omitted).capitalize()} are unobservable and were left out."
    yield Text(paragraph=f"{words} {describe_datum(found)}")
    yield Table(
        columns=parse_columns(
            "Pass; Chi-square .1; Degrees of freedom .1; Probability without drift .3"
        ),
        rows=[
            (test.name or "all together", test.statistic, test.degrees_of_freedom, test.p_value)
            for test in found.tests
        ],
        caption="Test of the corrections against noise alone: a small probability means that the "
        "passes drifted.",
    )
    if found.closures:
        yield Table(
            columns=parse_columns("Loop; Before [mm] .2; After [mm] .2"),
            rows=[
                (" - ".join(one.passes), to_millimetres(one.before), to_millimetres(one.after))
                for one in found.closures
            ],
            caption="Closure of loops: sum of the median differences around a loop of passes that "
            "overlap one after the other.",
        )
    alone = [(one.name, begin, end) for one in found.corrections for begin, end in one.unsupported]
    if alone:
        yield Table(
            columns=parse_columns("Pass; From [s] .1; To [s] .1"),
            rows=alone,
            caption="Times at which no other pass sees the same ground: the correction there is "
            "interpolated by the process model, and its standard deviation grows.",
        )
