"""A page as a reader's program sees it."""

import base64
import json
import re
from html.parser import HTMLParser

import matplotlib.pyplot as plt
import numpy as np
import pytest

from trueterrain.core.schemas import make_surface
from trueterrain.report import Report, Section, write_report

VOID = {"meta", "img", "br", "hr", "input", "link"}


class Page(HTMLParser):
    """Elements in order, the text of each, and whether they nest."""

    def __init__(self, source):
        super().__init__()
        self.source = source
        self.elements = []  # (name, attributes, text inside, texts of what is inside it too)
        self._open = []
        self.feed(source)
        self.close()
        assert self._open == [], "every element is closed"

    def handle_starttag(self, tag, attrs):
        element = {"tag": tag, **dict(attrs), "text": ""}
        self.elements.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_endtag(self, tag):
        assert self._open.pop()["tag"] == tag, f"</{tag}> closes what was opened last"

    def handle_data(self, data):
        for element in self._open:
            element["text"] += data

    def all(self, tag, **attributes):
        """Elements of a name that have these attributes."""
        return [
            element
            for element in self.elements
            if element["tag"] == tag
            and all(element.get(name.rstrip("_")) == value for name, value in attributes.items())
        ]

    def texts(self, tag, **attributes):
        """Texts of these elements as they are shown: spaces and line ends are one space."""
        shown = (element["text"].strip(" \n") for element in self.all(tag, **attributes))
        return [re.sub(r"[ \n]+", " ", text) for text in shown]

    @staticmethod
    def unpacked(array):
        """Values of an array as plotly packs it."""
        shape = [int(size) for size in str(array.get("shape", -1)).split(",")]
        return np.frombuffer(base64.b64decode(array["bdata"]), array["dtype"]).reshape(shape)

    def figures(self):
        """What each view draws, and where its nodes lie."""
        return [json.loads(found["text"]) for found in self.all("script", class_="figure")]


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


@pytest.fixture(scope="session")
def written():
    """Write a report into a folder and read the page."""

    def write(report, folder):
        path = folder / "report.html"
        write_report(report, path, force=True)
        return Page(path.read_text(encoding="utf-8"))

    return write


@pytest.fixture
def page_of(tmp_path, written, monkeypatch):
    """Write a report, or blocks as the only section of one, and read the page.

    The program of 5 MB that turns surfaces is left out, to save time.
    """
    monkeypatch.setattr("trueterrain.report.write._plotly_source", lambda: "/* plotly.js */")

    def write(*parts, **fields):
        if parts and isinstance(parts[0], Report):
            report = parts[0]
        else:
            section = Section(title="Found", blocks=parts)
            report = Report(title="Road", sections=(section,), **fields)
        return written(report, tmp_path)

    return write


@pytest.fixture(scope="session")
def bend():
    """Road of 6 m by 2 m on a curve far from the origin, with a hole and standard deviations."""
    u, v = 0.05 * np.arange(121), 0.1 * np.arange(-10, 11)
    heading = np.linspace(0.2, 0.6, 120)
    height = 103.0 + 0.02 * np.sin(3 * u)[:, None] + 0.01 * v
    height[40:50, 5:9] = np.nan
    return make_surface(
        height,
        u=u,
        v=v,
        easting=412_300.0 + np.concatenate([[0.0], np.cumsum(0.05 * np.cos(heading))]),
        northing=5_318_200.0 + np.concatenate([[0.0], np.cumsum(0.05 * np.sin(heading))]),
        sd=np.where(np.isnan(height), np.nan, 1e-4 * (1 + u)[:, None]),
        count=np.isfinite(height) * 7,
    )
