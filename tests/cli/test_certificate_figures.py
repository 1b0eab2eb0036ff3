"""Every figure of a certificate, page and PDF, is recomputed from the files next to it.

A figure that has no counterpart here fails the test, in a table as well as in a sentence. Findings
and modes are compared with result.json; what they find is tested where the faults are known.
"""

import json
import math
import re
import tomllib
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from pypdf import PdfReader
from scipy.signal import detrend
from scipy.signal.windows import dpss

import trueterrain
from trueterrain.core.schemas import make_profile

from ._certificate import (
    BOUND,
    CUT,
    ENOUGH,
    MILLI,
    Fit,
    Page,
    beside_edges,
    distances,
    number,
    numbers,
    over_distance,
    over_plate,
    scale,
    sha256,
    slug,
)

pytestmark = pytest.mark.slow

SUM = 1e-12  # [m] rounding of sums of some thousand terms
FLAT = 5e-3  # fraction by which costs of shifts 10 um from the minimum may be less: upright faces
SPECTRUM = 1e-9  # [1] relative
DECIBEL = 1e-9  # [dB]
ROWS = ("RMS", "off edges", "distance", "bias")
INSTRUMENTS = {"s": MILLI, "rad": math.degrees(1.0), "m": MILLI}


@pytest.fixture(scope="module")
def certified(tmp_path_factory, machined, recorded):
    """Folders with certificates of all three tests."""
    from trueterrain.cli.verify import verify

    folder = tmp_path_factory.mktemp("certified")
    s = np.arange(1201.0)
    rng = np.random.default_rng(3)
    for name in ("a", "b", "c"):
        error = 0.002 + 1e-3 * rng.normal(size=s.size) + 1e-4 * rng.normal(size=s.size).cumsum()
        trueterrain.write(make_profile(s, 0.1 * np.sin(s / 30) + error), folder / f"{name}.csv")
    trueterrain.write(make_profile(s, 0.1 * np.sin(s / 30)), folder / "true.csv")
    texts = {
        "static": f'title = "Acceptance"\nsystem = "Scanner <A&B>"\ndate = "2026-03-12"\n'
        f'run = "{recorded}/stand-run.zarr"\nmachined = "{machined}"\n'
        "limits = {off_edges = 0.001, noise = 0.0001, bias = 0.01}\n"
        "test = {assumed = -0.695, search = 0.05, screening = {saturation = 19999.0}}\n",
        "dynamic": f'runs = {{wavy = "{recorded}/drive-run.zarr"}}\nmachined = "{machined}"\n'
        'methods = ["navigation", "rts"]\ncautious = true\nlimits = {rms = 0.002}\n',
        "drift": 'profiles = ["a.csv", "b.csv", "c.csv"]\nreference = "true.csv"\n'
        "limits = {rms = 0.02, maximum = 0.001}\n",
        "alone": 'profiles = ["a.csv", "b.csv"]\n',
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
        kind = "drift" if name == "alone" else name
        verify(kind, folder / f"{name}.toml", output=folder / name)
    return folder


@pytest.fixture(params=["static", "dynamic", "drift", "alone"])
def read(request, certified, machined):
    """A certificate, and its figures as they follow from the files."""
    return Certificate(certified, request.param, machined)


class Certificate:
    """A certificate with the figures that it must show, by section and first head of a table."""

    def __init__(self, above, name, machined):
        self.folder = above / name
        self.settings = tomllib.loads((above / f"{name}.toml").read_text())
        self.document = json.loads((self.folder / "result.json").read_text())
        self.page = Page((self.folder / "certificate.html").read_text())
        self.paper = PdfReader(self.folder / "certificate.pdf")
        self.kind = "drift" if name == "alone" else name
        plate = pd.read_csv(machined)
        plate.columns = ["s", "height", *plate.columns[2:]]
        self.plate = {column: plate[column].to_numpy() for column in ("s", "height")}
        config = above / f"{name}.toml"
        inputs = self.settings.get("runs") or {"": self.settings.get("run")}
        paths = [path for path in inputs.values() if path] + self.settings.get("profiles", [])
        paths += [self.settings[key] for key in ("machined", "reference") if key in self.settings]
        self.inputs = [config, *(above / path for path in paths)]
        self.rows = {row["test"]: row for row in self.document["rows"]}
        self.found = {
            row: over_distance(self.folder, "reference" in self.settings)
            if self.kind == "drift"
            else over_plate(self.folder, row, self.plate)
            for row in self.rows
        }
        for row, one in self.found.items():
            if self.kind == "drift":
                one["registration"] = None
                continue
            registration = self.rows[row]["registration_found"]
            points = pd.read_csv(self.folder / f"registration-{slug(row)}.csv")
            one["fit"] = Fit(points, self.plate, turned=registration["reversed"])
            one["shift"] = registration["shift"]
            one["offset"], one["tilt"], one["residuals"] = one["fit"].at(one["shift"])
            inside = np.abs(one["residuals"]) <= CUT * scale(one["residuals"])
            one["registration"] = np.sqrt(np.mean(one["residuals"][inside] ** 2))
            one["outliers"], one["points"] = int((~inside).sum()), inside.size
            assumed = self.settings.get("test", {}).get("assumed")
            residual = None if assumed is None else one["fit"].at(assumed)[2]
            one["unregistered"] = None if residual is None else np.sqrt(np.mean(residual**2))

    def kept(self, row, limit):
        """Whether a figure keeps its limit, by its name."""
        found = self.found[row]
        name = {"rms": "RMS"}.get(limit, limit.replace("_", " "))
        value = found["values"].get(name, found.get(limit))
        if self.settings.get("cautious") and name in found["figures"]:
            one = found["figures"][name]
            value = max(abs(one.low), abs(one.high))
            if one.independent < ENOUGH:
                return False
        return abs(value) <= self.settings["limits"][limit]

    @property
    def limits(self):
        return [
            (row, limit)
            for row in self.rows
            for limit in ("rms", "off_edges", "distance", "maximum", "bias", "noise")
            if limit in self.settings.get("limits", {})
        ]

    def tables(self):
        """Rows that tables must show, by section and first head: words as words, figures in mm."""
        expected = {}
        stated = [
            [name.capitalize(), self.settings.get(name) or None]
            for name in ("system", "conditions", "date")
        ]
        expected["What was tested", "Stated"] = [*stated, ["Test", self.kind]]
        runs = [path for path in self.inputs if path.suffix == ".zarr"]
        timeless = [(path.name, "times count from any moment") for path in runs]
        profiles = self.settings.get("profiles", [])
        timeless += [(profile, "profiles hold no times") for profile in profiles]
        expected["What was tested", "Recorded"] = [
            [name, None, None, f"not in the data: {why}"] for name, why in timeless
        ]
        expected["Figures", "Test", "RMS"] = [
            [
                row,
                *(
                    millis(value)
                    for value in (
                        one["values"]["RMS"],
                        one["values"].get("off edges"),
                        one["values"].get("distance"),
                        one["maximum"],
                        one["values"]["bias"],
                        one["noise"],
                        one["registration"],
                    )
                ),
                one["n"],
            ]
            for row, one in self.found.items()
        ]
        expected["Figures", "Test", "Figure", "Value"] = [
            [
                row,
                name,
                MILLI * one["values"][name],
                MILLI * one["figures"][name].low,
                MILLI * one["figures"][name].high,
                one["figures"][name].independent,
            ]
            for row, one in self.found.items()
            for name in ROWS
            if name in one["figures"]
        ]
        if self.limits:
            expected["Figures", "Test", "Figure", "Limit"] = [
                [
                    row,
                    limit.replace("_", " "),
                    MILLI * self.settings["limits"][limit],
                    "✓ as required" if self.kept(row, limit) else "✗ not as required",
                ]
                for row, limit in self.limits
            ]
        for row, one in self.found.items():
            section = row[:1].upper() + row[1:]
            expected |= (
                self._drift(section, one)
                if self.kind == "drift"
                else (self._over_plate(section, one, self.rows[row]))
            )
        expected["Inputs and files", "Input"] = [[path.name, sha256(path)] for path in self.inputs]
        return expected

    def _over_plate(self, section, one, row):
        total = sum(one["parts"].values())
        expected = {
            (section, "Registration"): [
                ["Start of the plate in the measured profile", millis(one["shift"]), "mm"],
                ["Offset", millis(one["offset"]), "mm"],
                ["Tilt", MILLI * math.atan(one["tilt"]), "mrad"],
                ["Residual without outliers", millis(one["registration"]), "mm"],
                [
                    "Residual at the assumed place, before the shift",
                    millis(one["unregistered"]),
                    "mm",
                ],
            ],
            (section, "Part of the error"): [
                [name, MILLI * math.sqrt(value), 100 * value / total]
                for name, value in one["parts"].items()
            ],
        }
        words = {True: "found", False: "not found", None: "not observable"}
        expected[section, "Looked for"] = [
            [
                finding["name"],
                *(
                    None
                    if finding[key] is None
                    else finding[key] * INSTRUMENTS.get(finding["unit"], 1.0)
                    for key in ("value", "sd")
                ),
                {"s": "ms", "rad": "deg", "m": "mm", "1": None}.get(
                    finding["unit"], finding["unit"]
                ),
                words[finding["detected"]],
                finding["meaning"],
            ]
            for finding in row.get("findings", [])
        ]
        if "modes" in row:
            motions = dict.fromkeys(name for mode in row["modes"] for name in mode["coherence"])
            expected[section, "Band"] = [
                [
                    mode["name"],
                    mode["low"],
                    mode["high"],
                    None if mode["fraction"] is None else 100 * mode["fraction"],
                    millis(mode["rms"]),
                    *(mode["coherence"].get(name) for name in motions),
                ]
                for mode in row["modes"]
            ]
        return expected

    def _drift(self, section, one):
        repeats = one["repeatability"]
        return {
            (section, "Part of the error"): [
                [
                    "Repeatability of a single run",
                    MILLI * one["noise"],
                    MILLI * repeats.low,
                    MILLI * repeats.high,
                ],
                [
                    "Bias common to all runs",
                    *([None] * 3 if one["shared"] is None else [MILLI * x for x in one["shared"]]),
                ],
            ]
        }

    def figures_in_words(self):
        """Figures that sentences and tiles may name, in mm and in their own units."""
        allowed = [95.0, 100.0]  # confidence [%], and cases of which one is beyond a coherence
        for row, one in self.found.items():
            allowed.append(MILLI * one["maximum"])
            for figure in one["figures"].values():
                allowed += [MILLI * figure.value, MILLI * figure.low, MILLI * figure.high]
            few = [
                figure.independent
                for figure in one["figures"].values()
                if figure.independent < ENOUGH
            ]
            allowed += [max(few)] if few else []
            allowed += [one[name] for name in ("outliers", "points", "runs") if name in one]
            table = one["table"]
            if "time" in table:
                allowed.append(abs(np.polyfit(table["time"], table["along"], 1)[0]))
            allowed += [mode["threshold"] for mode in self.rows[row].get("modes", [])]
            for finding in self.rows[row].get("findings", []):
                scale = INSTRUMENTS.get(finding["unit"], 1.0)
                allowed += [
                    finding[key] * scale
                    for key in ("value", "sd")
                    if finding["detected"] and finding[key] is not None
                ]
        allowed += [MILLI * limit for limit in self.settings.get("limits", {}).values()]
        return [*allowed, self.flags]

    @property
    def flags(self):
        """How many rows have figures of few independent errors, and how many faults were found."""
        few = sum(
            any(figure.independent < ENOUGH for figure in one["figures"].values())
            for one in self.found.values()
        )
        rows = self.rows.values()
        return few + sum(bool(one["detected"]) for row in rows for one in row.get("findings", []))

    def without_names(self, text):
        """The same without hashes, versions and names, whose digits are no figures."""
        for known in (trueterrain.__version__, "SHA-256", *self.settings.get("date", "").split()):
            text = text.replace(known, " ")
        return re.sub(r"\b[0-9a-f]{64}\b", " ", text)


def millis(value):
    return None if value is None else MILLI * value


def compared(shown, expected, place):
    """Whether a cell shows what it must."""
    if isinstance(expected, str) or expected is None:
        assert shown.strip() == (expected if expected is not None else "–"), place
        return
    value, half = number(shown)
    assert_allclose(value, expected, rtol=0, atol=half * (1 + 1e-6) + SUM, err_msg=str(place))


def test_every_table_agrees_with_the_files(read):
    expected = read.tables()
    for section, tables in read.page.sections.items():
        for _, heads, rows in tables:
            words = [re.sub(r" *\[.*", "", head.strip()) for head in heads]
            if words[0] == "File":
                continue  # looked at below
            keys = [
                key
                for key in expected
                if key[0] == section and list(key[1:]) == words[: len(key) - 1]
            ]
            assert len(keys) == 1, f"{section}, {words}: has no counterpart"
            wanted = expected.pop(keys[0])
            assert len(rows) == len(wanted), keys
            for row, cells in zip(rows, wanted, strict=True):
                assert len(row) == len(cells), (keys, row)
                for shown, cell in zip(row, cells, strict=True):
                    compared(shown, cell, (keys, row))
    assert expected == {}, "a table is missing"


def test_every_figure_in_a_sentence_follows_from_the_files(read):
    allowed = np.array(read.figures_in_words())
    text = " ".join(read.page.words)
    for row in read.document["rows"]:
        text = text.replace(row.get("source", "\0"), " ")
        for finding in row.get("findings", []):  # compared with the table, word by word
            text = text.replace(finding["meaning"], " ")
    for shown in numbers(read.without_names(text)):
        value, half = number(shown)
        assert np.abs(allowed - value).min() <= half * (1 + 1e-6), f"{shown}: {text}"


def test_tiles_show_the_first_figures(read):
    for tile, (row, one) in zip(read.page.tiles, read.found.items(), strict=False):
        label, value, *rest = tile
        assert label == f"RMS, {row}"
        compared(value.replace("mm", ""), MILLI * one["values"]["RMS"], tile)
        low, high = numbers(rest[-1])[:2]
        compared(low, MILLI * one["figures"]["RMS"].low, tile)
        compared(high, MILLI * one["figures"]["RMS"].high, tile)
        few = one["figures"]["RMS"].independent < ENOUGH
        assert rest[-1].strip().startswith("at least") == few
        if "rms" in read.settings.get("limits", {}):
            mark = "✓ as required" if read.kept(row, "rms") else "✗ not as required"
            assert " ".join(rest[0].split()) == mark
    if read.limits:
        kept = all(read.kept(row, limit) for row, limit in read.limits)
        said = ["kept", "✓ as required"] if kept else ["not kept", "✗ not as required"]
        assert [" ".join(words.split()) for words in read.page.tiles[-1][1:]] == said
        assert read.document["passed"] is kept
    else:
        assert len(read.page.tiles) == len(read.found)


def test_the_pdf_shows_the_same_figures_and_no_others(read):
    paper = " ".join(page.extract_text() for page in read.paper.pages)
    paper = re.sub(r"Page \d+ of \d+", " ", paper)
    page = Counter(numbers(read.without_names(" ".join(read.page.all))))
    assert Counter(numbers(read.without_names(paper))) == page
    for path in read.inputs:
        assert sha256(path) in paper


def test_result_json_holds_the_same_figures(read):
    for row, one in read.found.items():
        reported = read.rows[row]
        for name, value in one["values"].items():
            key = {"RMS": "rms"}.get(name, name.replace(" ", "_"))
            assert_allclose(reported[key]["value"], value, rtol=0, atol=SUM)
            for end in ("low", "high"):
                assert_allclose(reported[key][end], getattr(one["figures"][name], end), atol=SUM)
        for name in ("maximum", "noise"):
            assert_allclose(reported[name], one[name], rtol=0, atol=SUM)
        assert reported["count"] == one["n"]
        assert reported["verdicts"] == {
            limit: read.kept(row, limit) for other, limit in read.limits if other == row
        }
    assert [one["sha256"] for one in read.document["inputs"]] == [
        sha256(path) for path in read.inputs
    ]


def test_sizes_of_files_are_as_stated(read):
    ((_, _, rows),) = [
        table for table in read.page.sections["Inputs and files"] if table[1][0] == "File"
    ]
    for name, _, size in rows:
        value, unit = size.replace("\u202f", " ").replace("\u00a0", " ").split()
        digits = len(value.partition(".")[2])
        factor = {"B": 1, "kB": 1e3, "MB": 1e6}[unit]
        actual = (read.folder / name).stat().st_size / factor
        assert_allclose(float(value), actual, rtol=0, atol=0.5 * 10.0**-digits * (1 + 1e-6))
    named = {name for name, *_ in rows} | {"certificate.html", "certificate.pdf", "manifest.json"}
    assert named == {path.name for path in read.folder.iterdir()}


@pytest.fixture(params=["static", "dynamic"])
def over(request, certified, machined):
    """A certificate of a test over a plate."""
    return Certificate(certified, request.param, machined)


def test_single_errors_follow_from_measured_and_machined_heights(over):
    for one in over.found.values():
        table = one["table"]
        s, along = table["s"].to_numpy(), table["along"].to_numpy()
        assert_allclose(one["fit"].positions(along, one["shift"]), s, rtol=0, atol=SUM)
        level = one["offset"] + one["tilt"] * (along - one["shift"] - 0.5 * one["fit"].length)
        assert_allclose(table["height"], table["up"] - level, rtol=0, atol=1e-9)
        assert_allclose(table["error"], table["height"] - table["machined"], rtol=0, atol=SUM)
        reach = 0.005 if over.kind == "static" else 0.01  # [m] defaults of the tests
        assert (beside_edges(over.plate, s, reach) == (table["edge"] == 1)).all()
        away = distances(over.plate, s, table["height"].to_numpy())
        assert_allclose(table["distance"], away, rtol=0, atol=SUM)
        if over.kind == "static":
            nodes = over.plate["s"] - over.plate["s"][0]
            true = np.interp(s, nodes, over.plate["height"])
            assert_allclose(table["machined"], true, rtol=0, atol=SUM)


def test_no_other_shift_fits_better(over):
    """Neither close by, nor a millimetre around it by more than a point that comes or goes."""
    for one in over.found.values():
        fit, cut = one["fit"], max(CUT * scale(one["residuals"]), BOUND)
        cost = fit.cost(one["shift"], cut)
        close = min(fit.cost(one["shift"] + by, cut) for by in (-2e-5, -1e-5, 1e-5, 2e-5))
        assert cost <= (1 + FLAT) * close
        around = min(fit.cost(one["shift"] + by, cut) for by in np.linspace(-1e-3, 1e-3, 101))
        assert cost <= around + cut**2 / one["points"]
        turned = Fit(pd.DataFrame({"along": fit.x, "up": fit.z}), over.plate, turned=not fit.turned)
        assert cost < turned.cost(one["shift"], cut)


def test_rejection_follows_from_the_errors(certified, machined):
    """Without floor all errors are in the file; of the motion of the laser its spectrum is."""
    read = Certificate(certified, "dynamic", machined)
    for row, one in read.found.items():
        table = one["table"].sort_values("time")
        found = pd.read_csv(read.folder / f"rejection-{slug(row)}.csv")
        time, plain = table["time"].to_numpy(), table["edge"].to_numpy() == 0
        even = np.linspace(time[0], time[-1], time.size)
        error = detrend(np.interp(even, time[plain], table["error"].to_numpy()[plain]))
        step = (time[-1] - time[0]) / (time.size - 1)
        power = np.abs(np.fft.rfft(dpss(time.size, 2.5, 4) * error, axis=1)) ** 2
        density = 2 * step * power.mean(axis=0)[-len(found) :]
        assert_allclose(found["error"], density, rtol=SPECTRUM)
        ratio = 10 * np.log10(found["motion"] / found["error"])
        assert_allclose(found["rejection"], ratio, rtol=0, atol=DECIBEL)
        for name in found:
            assert_allclose(read.rows[row]["rejection"][name], found[name], rtol=SPECTRUM)


@pytest.mark.parametrize("name", ["drift", "alone"])
def test_growth_follows_from_the_errors(certified, machined, name):
    read = Certificate(certified, name, machined)
    (one,) = read.found.values()
    found = pd.read_csv(read.folder / "growth-drift.csv")
    for at, lag in enumerate(np.rint(found["distance"]).astype(int)):  # places are 1 m apart
        for column, values in (("structure", one["error"]), ("repeats", one["apart"])):
            change = values[:, lag:] - values[:, :-lag]
            assert_allclose(found[column][at], np.sqrt(np.mean(change**2)), rtol=0, atol=SUM)
        means = np.stack([np.convolve(row, np.ones(lag) / lag, "valid") for row in one["error"]])
        steps = means[:, lag:] - means[:, :-lag]
        assert_allclose(found["allan"][at], np.sqrt(np.mean(steps**2) / 2), rtol=0, atol=1e-11)
