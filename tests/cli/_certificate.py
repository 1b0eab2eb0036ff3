"""A certificate as read by a third party, and its figures recomputed from the files.

Only the bootstrap of intervals is that of the package, with its seed; all else is numpy.
"""

import hashlib
import math
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd

from trueterrain.verify.statistics.uncertainty import mean_figure, rms_figure

MILLI = 1e3
MINUS, MISSING = "\N{MINUS SIGN}", "\N{EN DASH}"
HUBER, CUT, NMAD, MIN_SCALE, ITERATIONS = 1.345, 3.0, 1.4826, 5e-5, 12  # of the registration
BOUND = 0.003  # [m] residual beyond which a point costs no more
STEEP = 0.5  # [m/m] slope of an edge
ENOUGH = 20.0  # independent errors from which an interval is trusted


class Page(HTMLParser):
    """Sections of a page with their tables, its tiles, and all else that it says."""

    def __init__(self, source):
        super().__init__()
        self.sections = {"": []}  # tables by title of the section: (caption, heads, rows)
        self.tiles = []  # texts of each
        self.words = []  # outside of the cells of tables
        self.all = []
        self._section, self._open = "", []
        self.feed(source)

    def handle_starttag(self, tag, attrs):
        if tag in ("img", "meta", "br", "link"):
            return
        self._open.append(tag)
        if tag == "table":
            self.sections[self._section].append(["", [], []])
        elif tag == "tr" and "tbody" in self._open:
            self._table()[2].append([])
        elif tag in ("th", "td"):
            (self._table()[2][-1] if "tbody" in self._open else self._table()[1]).append("")
        elif tag == "dl":
            self.tiles = []
        elif tag == "div" and "dl" in self._open:
            self.tiles.append([])
        elif tag in ("dt", "dd"):
            self.tiles[-1].append("")
        elif tag == "h2":
            self._section = ""

    def handle_endtag(self, tag):
        while self._open and self._open.pop() != tag:
            pass
        if tag == "h2":
            self.sections[self._section] = []

    def handle_data(self, data):
        if {"style", "script", "head"} & set(self._open) or not data.strip():
            return
        self.all.append(data)
        if "h2" in self._open:
            self._section += data
        elif {"th", "td"} & set(self._open):
            table = self._table()
            row = table[2][-1] if "tbody" in self._open else table[1]
            row[-1] += data
            return
        elif "caption" in self._open:
            self._table()[0] += data
        elif {"dt", "dd"} & set(self._open):
            self.tiles[-1][-1] += data
        self.words.append(data)

    def _table(self):
        return self.sections[self._section][-1]


def number(cell):
    """Value of a cell and half of its last digit, or None where it shows that there is none."""
    text = re.sub(r"[\u202f\u00a0]", "", cell.strip()).replace(MINUS, "-")
    if text == MISSING:
        return None
    return float(text), 0.5 * 10.0 ** -len(text.partition(".")[2])


def numbers(text):
    """Figures in a text, as they are written."""
    joined = re.sub(r"(?<=\d)[\u202f\u00a0](?=\d{3})", "", text)
    return re.findall(rf"(?<![\w.,{MINUS}-]){MINUS}?\d+(?:\.\d+)?(?![\w]|\.\d)", joined)


def sha256(path):
    """Hash of a file, or of the names, sizes and contents of all files in a folder, in order."""
    digest = hashlib.sha256()
    if path.is_dir():
        inside = sorted(
            file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file()
        )
        for name in inside:
            content = (path / name).read_bytes()
            digest.update(name.encode() + b"\0" + str(len(content)).encode() + b"\0" + content)
    else:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def slug(name):
    return re.sub(r"[ ,]+", "-", name)


def scale(residual):
    """Robust standard deviation."""
    apart = np.abs(residual - np.median(residual))
    return max(NMAD * float(np.median(apart)), MIN_SCALE)


class Fit:
    """A machined profile laid onto measured points by Huber's weights."""

    def __init__(self, points, plate, *, turned):
        self.x, self.z = points["along"].to_numpy(), points["up"].to_numpy()
        self.s, self.h = plate["s"] - plate["s"][0], plate["height"]
        self.length, self.turned = self.s[-1], turned
        if turned:
            self.s, self.h = self.length - self.s[::-1], self.h[::-1]

    def positions(self, along, shift):
        """Places on the machined profile."""
        return self.length - (along - shift) if self.turned else along - shift

    def at(self, shift):
        """Offset, slope, and residuals with the plate at a shift."""
        on = (self.x >= shift) & (self.x < shift + self.length)
        t = self.x[on] - shift
        y = self.z[on] - np.interp(t, self.s, self.h)
        shape = np.stack([np.ones_like(t), t - 0.5 * self.length], axis=1)
        weight = np.ones_like(t)
        for _ in range(ITERATIONS):
            root = np.sqrt(weight)
            found = np.linalg.lstsq(shape * root[:, None], y * root, rcond=None)[0]
            residual = y - shape @ found
            limit = HUBER * scale(residual)
            weight = np.minimum(1.0, limit / np.maximum(np.abs(residual), 1e-12))
        return found[0], found[1], residual

    def cost(self, shift, cut):
        return float(np.mean(np.minimum(self.at(shift)[2] ** 2, cut**2)))


def distances(plate, s, height):
    """Shortest distance of points from the line through the nodes."""
    nodes = np.stack([plate["s"] - plate["s"][0], plate["height"]], axis=1)
    begin, segment = nodes[:-1], np.diff(nodes, axis=0)
    found = []
    for point in np.stack([s, height], axis=1):
        fraction = ((point - begin) * segment).sum(axis=1) / (segment**2).sum(axis=1)
        nearest = begin + np.clip(fraction, 0.0, 1.0)[:, None] * segment
        found.append(np.hypot(*(point - nearest).T).min())
    return np.array(found)


def beside_edges(plate, s, reach):
    """Whether places are beside a steep piece, or an end of the plate."""
    nodes = plate["s"] - plate["s"][0]
    steep = np.abs(np.diff(plate["height"])) > STEEP * np.diff(nodes)
    begins = np.concatenate([[-np.inf, nodes[-1]], nodes[:-1][steep]])
    ends = np.concatenate([[nodes[0], np.inf], nodes[1:][steep]])
    return ((s[:, None] >= begins - reach) & (s[:, None] <= ends + reach)).any(axis=1)


def over_plate(folder, name, plate, confidence=0.95):
    """Figures of a test over a plate from its CSV."""
    table = pd.read_csv(folder / f"errors-{slug(name)}.csv")
    error, edge = table["error"].to_numpy(), table["edge"].to_numpy() == 1
    standing = "sd_mean" in table
    of_mean = table["sd_mean" if standing else "sd"].to_numpy()
    single = table["sd"] ** 2 if standing else (table["sd"] ** 2 * table["count"])[~edge]
    flagged = table["flagged"].to_numpy() == 1 if standing else np.zeros_like(edge)
    faces = sum(1 for k in range(edge.size) if edge[k] and (k == 0 or not edge[k - 1]))
    most = {"confidence": confidence, "most": faces or math.inf}
    figures = {
        "RMS": rms_figure(error, **most),
        "off edges": rms_figure(error[~edge], confidence=confidence),
        "distance": rms_figure(table["distance"], **most),
        "bias": mean_figure(error, **most),
    }
    plain = ~edge & ~flagged
    rest = error[plain]
    spread = float(np.mean((rest - rest.mean()) ** 2))
    random = min(float(np.mean(of_mean[plain] ** 2)), spread)
    n = error.size
    parts = {
        "noise of the mean": plain.sum() / n * random,
        "bias": plain.sum() / n * rest.mean() ** 2,
        "neither noise nor bias": plain.sum() / n * (spread - random),
        "at edges": (error[edge] ** 2).sum() / n,
        "flagged intensity": (error[flagged & ~edge] ** 2).sum() / n,
    }
    return {
        "table": table,
        "figures": figures,
        "parts": parts,
        "n": n,
        "values": {
            "RMS": np.sqrt(np.mean(error**2)),
            "off edges": np.sqrt(np.mean(error[~edge] ** 2)),
            "distance": np.sqrt(np.mean(table["distance"] ** 2)),
            "bias": error.mean(),
        },
        "maximum": np.abs(error).max(),
        "noise": np.sqrt(np.mean(single)),
    }


def over_distance(folder, referenced, confidence=0.95):
    """Figures of a drift test from its CSV."""
    table = pd.read_csv(folder / "errors-drift.csv")
    error = table[[name for name in table if name.startswith("error_")]].to_numpy().T
    runs = len(error)
    apart = error - error.mean(axis=0)
    if referenced:
        apart *= math.sqrt(runs / (runs - 1))
    else:  # errors are those about the mean already, enlarged
        apart = error
    repeatability = rms_figure(apart, confidence=confidence)
    shared = None
    if referenced:
        mean = rms_figure(error.mean(axis=0), confidence=confidence)
        chance = float(np.mean(apart**2)) / runs
        shared = [math.sqrt(max(one**2 - chance, 0)) for one in (mean.value, mean.low, mean.high)]
    figures = {
        "RMS": rms_figure(error, confidence=confidence),
        "bias": mean_figure(error, confidence=confidence),
    }
    return {
        "table": table,
        "error": error,
        "apart": apart,
        "figures": figures,
        "n": error.size,
        "values": {"RMS": np.sqrt(np.mean(error**2)), "bias": error.mean()},
        "maximum": np.abs(error).max(),
        "noise": np.sqrt(np.mean(apart**2)),
        "repeatability": repeatability,
        "shared": shared,
        "runs": runs,
    }
