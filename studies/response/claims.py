"""What the text of the page says in words, checked against each run before it is written."""

from judge import Judged, Verdict
from page import NUMBERS, value

BLOCKS = "measured block", "generated block"
LINE = "line", "bare line"
MEDIAN = "median", "r = 25 mm"
LASER = "envelope on a profile", "radial springs on the line laser"
STATISTICS = "median", "mean", "70th percentile", "85th percentile", "95th percentile"


def require_claims(judged: list[Judged]) -> None:
    """Raise SystemExit with every sentence of the page that this run contradicts."""
    wrong = [sentence for sentence, holds in claims(judged) if not holds]
    if wrong:
        raise SystemExit("The page would say what was not found:\n- " + "\n- ".join(wrong))


def claims(judged: list[Judged]) -> list[tuple[str, bool]]:
    """Sentences, and whether they hold."""

    def of(what: str, which: tuple[str, str], road: str) -> float:
        return value(judged, what, *which, road)

    discs = [
        (verdict.group, verdict.name)
        for verdict in judged[0].verdicts if verdict.group in STATISTICS
    ]  # fmt: skip
    profiles = [
        (verdict.group, verdict.name)
        for verdict in judged[0].verdicts if verdict.group == LASER[0]
    ]  # fmt: skip

    anywhere = [
        (verdict.group, verdict.name)
        for verdict in judged[0].verdicts
        if verdict.group not in ("the reference, otherwise", "envelope on the surface")
    ]

    by_damage = [LINE, MEDIAN, ("85th percentile", "r = 100 mm"), LASER]

    def least(some: list[tuple[str, str]], road: str, what: str = "force") -> tuple[str, str]:
        return min(some, key=lambda which: abs(of(what, which, road)))

    return [
        (
            "asphalt: the median of 25 mm takes away more than half of the bare line's error",
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
                for what in ("force", "acceleration", "travel") for road in BLOCKS
            ),
        ),
        (
            "blocks: a high percentile at 100 mm is the best disc",
            all(
                least(discs, road)
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
        ("asphalt: the median is the best disc", least(discs, "asphalt")[0] == "median"),
        ("highway: the mean is the best disc", least(discs, "highway")[0] == "mean"),
        (
            "all roads: the 70th percentile at 100 mm is the best disc for the force",
            least(discs, "mean") == ("70th percentile", "r = 100 mm"),
        ),
        (
            "all roads: the 85th percentile at 75 mm is the best disc for acceleration and travel",
            all(
                least(discs, "mean", what) == ("85th percentile", "r = 75 mm")
                for what in ("acceleration", "travel")
            ),
        ),
        (
            "springs on the line laser are the best tyre on a profile",
            least(profiles, "mean") == LASER and least(profiles, "mean", "acceleration") == LASER,
        ),
        (
            "no other profile is nearer to the force, on average",
            least(anywhere, "mean") == LASER,
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
                for road in judged for verdict in road.verdicts
                if verdict.group in ("line", *STATISTICS)
            ),
        ),
        (
            "measured block: damage falls from bare line to median, percentile, tyre on the laser",
            [of("damage", which, "measured block") for which in by_damage]
            == sorted((of("damage", which, "measured block") for which in by_damage), reverse=True),
        ),
        (
            "the cams as judge put the 70th percentile at 100 mm at half the error of the thesis",
            of("by_cams", ("70th percentile", "r = 100 mm"), "mean")
            < 0.55 * of("by_cams", MEDIAN, "mean"),
        ),
        (
            "the full car judges as the quarter car does, within 12 % of the reference",
            all(
                abs(NUMBERS[f"full_{what}"](verdict) - NUMBERS[what](verdict)) < 0.12
                for what in ("acceleration", "force", "travel")
                for road in judged for verdict in road.verdicts
            ),
        ),
    ]  # fmt: skip


def verdicts_on(judged: list[Judged], course: str) -> list[Verdict]:
    """Verdicts on one road."""
    return next(road.verdicts for road in judged if road.course == course)
