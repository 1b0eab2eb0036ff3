"""Statements of the page in words, checked against each run before the page is written."""

from judge import Judged, Verdict
from page import NUMBERS, value
from spectra import DRAWN, ROWS
from truck import LASER as ON_LASER
from truck import STATISTICS as RANKS
from truck import WIDE_LASER, Rolled, best_radius, growths

BLOCKS = "measured block", "generated block"
LINE = "line", "bare line"
MEDIAN = "median", "r = 25 mm"
LASER = "envelope on a profile", "radial springs on the line laser"
STATISTICS = "median", "mean", "70th percentile", "85th percentile", "95th percentile"


def require_statements(judged: list[Judged], rolled: list[Rolled]) -> None:
    """Raise SystemExit with every statement of the page that this run contradicts."""
    found = table_statements(judged) + spectra_statements(judged) + tyre_statements(rolled)
    wrong = [statement for statement, holds in found if not holds]
    if wrong:
        raise SystemExit("This run contradicts statements of the page:\n- " + "\n- ".join(wrong))


def table_statements(judged: list[Judged]) -> list[tuple[str, bool]]:
    """Statements on the tables, and whether they hold."""

    def of(what: str, which: tuple[str, str], road: str) -> float:
        return value(judged, what, *which, road)

    discs = [
        (verdict.group, verdict.name)
        for verdict in judged[0].verdicts
        if verdict.group in STATISTICS
    ]
    profiles = [
        (verdict.group, verdict.name) for verdict in judged[0].verdicts if verdict.group == LASER[0]
    ]

    anywhere = [
        (verdict.group, verdict.name)
        for verdict in judged[0].verdicts
        if verdict.group not in ("the reference, otherwise", "envelope on the surface")
    ]

    by_damage = [LINE, MEDIAN, ("85th percentile", "r = 100 mm"), LASER]

    def best(some: list[tuple[str, str]], road: str, what: str = "force") -> tuple[str, str]:
        """Reduction with the smallest error."""
        return min(some, key=lambda which: abs(of(what, which, road)))

    return [
        (
            "asphalt: the median of 25 mm removes more than half of the bare line's error",
            of("force", MEDIAN, "asphalt") < 0.5 * of("force", LINE, "asphalt"),
        ),
        (
            "blocks, highway: the median of 25 mm leaves more than four fifths of it",
            all(
                of("force", MEDIAN, road) > 0.8 * of("force", LINE, road)
                for road in (*BLOCKS, "highway")
            ),
        ),
        (
            "blocks: the 85th percentile at 100 mm has less than half the error of the median "
            "of 25 mm, in force, acceleration and travel",
            all(
                of(what, ("85th percentile", "r = 100 mm"), road) < 0.5 * of(what, MEDIAN, road)
                for what in ("force", "acceleration", "travel")
                for road in BLOCKS
            ),
        ),
        (
            "blocks: a high percentile at 100 mm is the best disc",
            all(
                best(discs, road)
                in [("70th percentile", "r = 100 mm"), ("85th percentile", "r = 100 mm")]
                for road in BLOCKS
            ),
        ),
        (
            "asphalt: the median is nearer than the mean from 25 mm on",
            all(
                of("force", ("median", f"r = {r} mm"), "asphalt")
                < of("force", ("mean", f"r = {r} mm"), "asphalt")
                for r in (25, 50, 75, 100)
            ),
        ),
        ("asphalt: the median is the best disc", best(discs, "asphalt")[0] == "median"),
        ("highway: the mean is the best disc", best(discs, "highway")[0] == "mean"),
        (
            "all roads: the 70th percentile at 100 mm is the best disc for the force",
            best(discs, "mean") == ("70th percentile", "r = 100 mm"),
        ),
        (
            "all roads: the 85th percentile at 75 mm is the best disc for acceleration and travel",
            all(
                best(discs, "mean", what) == ("85th percentile", "r = 75 mm")
                for what in ("acceleration", "travel")
            ),
        ),
        (
            "springs on the line laser are the best tyre on a profile",
            best(profiles, "mean") == LASER and best(profiles, "mean", "acceleration") == LASER,
        ),
        (
            "no other profile is nearer to the force, on average",
            best(anywhere, "mean") == LASER,
        ),
        (
            "at 50 mm the steepest CPF is farther from the force than the median",
            of("force", ("other statistics, r = 50 mm", "steepest CPF"), "mean")
            > of("force", ("median", "r = 50 mm"), "mean"),
        ),
        (
            "a line laser by itself leaves more than three quarters of the bare line's error",
            all(
                of("force", ("envelope on the surface", "line laser of 100 mm"), road)
                > 0.74 * of("force", LINE, road)
                for road in (*BLOCKS, "asphalt", "highway")
            ),
        ),
        (
            "asphalt: the rigid disc is the worst of all",
            max(verdicts_on(judged, "asphalt"), key=NUMBERS["force"]).name == "rigid disc",
        ),
        (
            "blocks: the bare line moves the index most on the measured one",
            all(
                of("iri", LINE, road) < of("iri", LINE, "measured block")
                for road in ("generated block", "asphalt", "highway")
            ),
        ),
        (
            "no statistic and not even the bare line moves the index by more than 4 %",
            all(
                abs(NUMBERS["iri"](verdict)) < 0.04
                for road in judged
                for verdict in road.verdicts
                if verdict.group in ("line", *STATISTICS)
            ),
        ),
        (
            "measured block: damage falls from bare line to median, percentile, tyre on the laser",
            [of("damage", which, "measured block") for which in by_damage]
            == sorted((of("damage", which, "measured block") for which in by_damage), reverse=True),
        ),
        (
            "against the cams the 70th percentile at 100 mm has half the error of the thesis",
            of("by_cams", ("70th percentile", "r = 100 mm"), "mean")
            < 0.55 * of("by_cams", MEDIAN, "mean"),
        ),
        (
            "errors of the full car are those of the quarter car, within 12 % of the reference",
            all(
                abs(NUMBERS[f"full_{what}"](verdict) - NUMBERS[what](verdict)) < 0.12
                for what in ("acceleration", "force", "travel")
                for road in judged
                for verdict in road.verdicts
            ),
        ),
    ]


def spectra_statements(judged: list[Judged]) -> list[tuple[str, bool]]:
    """Statements below the figure, and whether they hold."""

    def off(which: tuple[str, str], road: str) -> float:
        return value(judged, "highest_band", *which, road)

    below_8_hz = [
        abs(float(ratio) - 1)
        for road in judged
        for verdict in road.verdicts
        if (verdict.group, verdict.name) in DRAWN
        for ratio in verdict.quarter.band_ratio.sel(quantity=list(ROWS))[:, :2].values.ravel()
    ]
    by_force = LINE, MEDIAN, ("70th percentile", "r = 100 mm"), LASER
    return [
        ("up to 8 Hz all that is drawn is within 4 % of the reference", max(below_8_hz) < 0.04),
        (
            "blocks: above 20 Hz force falls from bare line to median, percentile, tyre on a laser",
            all(
                [off(which, road) for which in by_force]
                == sorted((off(which, road) for which in by_force), reverse=True)
                and off(LASER, road) > 0
                for road in BLOCKS
            ),
        ),
        (
            "blocks: above 20 Hz the cams are a third below the reference",
            all(
                -0.43 < off(("envelope on the surface", "tandem cams"), road) < -0.28
                for road in BLOCKS
            ),
        ),
        (
            "highway: above 20 Hz the bare line is the worst of what is drawn",
            max(DRAWN, key=lambda which: abs(off(which, "highway"))) == LINE,
        ),
    ]


def tyre_statements(rolled: list[Rolled]) -> list[tuple[str, bool]]:
    """Statements on the truck's tyre, and whether they hold."""
    roads = {road.course: road for road in rolled}

    def best(tyre: str, road: str) -> str:
        found = roads[road].felt[tyre]
        return min(RANKS, key=lambda name: found[name, best_radius(roads[road], tyre, name)].longer)

    return [
        (
            "radii grow with the patch, by about a half on average",
            1.45 <= sum(growths(rolled)) / len(growths(rolled)) < 1.65,
        ),
        (
            "both tyres: 70th percentile on blocks, median on asphalt, mean on the highway",
            all(
                [best(tyre, road) for road in (*BLOCKS, "asphalt", "highway")]
                == ["70th percentile", "70th percentile", "median", "mean"]
                for tyre in ("passenger", "truck")
            ),
        ),
        (
            "both tyres: the laser as wide as the patch is nearer than that of 100 mm",
            all(
                road.felt[tyre][WIDE_LASER].longer < road.felt[tyre][ON_LASER].longer
                for road in rolled
                for tyre in road.felt
            ),
        ),
    ]


def verdicts_on(judged: list[Judged], course: str) -> list[Verdict]:
    """Verdicts on one road."""
    return next(road.verdicts for road in judged if road.course == course)
