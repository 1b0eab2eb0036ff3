"""Pages: they stand on their own, hold what they were given, and run nothing that they were not."""

import base64
import hashlib
import json
import re
import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from trueterrain._version import __version__
from trueterrain.core import provenance
from trueterrain.core.errors import OutputError
from trueterrain.report import (
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
    write_report,
)

EVIL = "<script>alert('\"&')</script>"
LOADS = ("src", "href", "action", "data", "poster", "srcset", "background", "formaction")


def plotted(points=20):
    """Figure with random, but always the same, dots."""
    ax = Figure(figsize=(5, 3)).add_subplot()
    ax.plot(*np.random.default_rng(1).random((2, points)), "o", rasterized=False)
    return ax


def everything(surface, folder):
    """One of each, with names as bad as can be."""
    (folder / "a b%.laz").write_bytes(b"12345")
    steps = provenance.provenance_steps(
        provenance.add_step(
            xr.Dataset(), EVIL, parameters={"name": EVIL}, inputs=[folder / "a b%.laz"]
        )
    )
    line = surface.isel(v=10, drop=True)[["height", "easting", "northing"]].rename(u="s")
    line.s.attrs["units"] = "m"
    return Report(
        title=f"Road {EVIL}",
        subtitle=EVIL,
        headline=(Number(label=EVIL, value=EVIL, unit=EVIL, note=EVIL),),
        sections=(
            Section(
                title=f"First {EVIL}",
                text=f"{EVIL}\n\nmore",
                blocks=(
                    Text(paragraph=EVIL),
                    Table(
                        columns=(Column(label=EVIL, unit=EVIL),),
                        rows=[(EVIL,)],
                        caption=EVIL,
                        verdicts=("good",),
                    ),
                    Warnings(items=(EVIL, "lane 2 is short")),
                    Picture(figure=plotted(), alt=EVIL, caption=EVIL),
                ),
            ),
            Section(
                title="Second",
                blocks=(
                    SurfaceView(surface=surface, caption=EVIL, lines={EVIL: line}),
                    SurfaceView(surface=surface, colour="sd"),
                    Files(files=(File(path="a b%.laz", note=EVIL),)),
                    Files(files=(File(path=f"javascript:{EVIL}", size=3),)),
                ),
            ),
        ),
        provenance={EVIL: steps},
    )


@pytest.fixture(scope="module")
def full(written, bend, tmp_path_factory):
    folder = tmp_path_factory.mktemp("full")
    return written(everything(bend, folder), folder)


def test_a_page_loads_nothing_from_elsewhere(full):
    found = [(e["tag"], e[name]) for e in full.elements for name in LOADS if e.get(name)]
    assert {tag for tag, _ in found} == {"a", "img"}
    assert all(
        address.startswith("data:image/" if tag == "img" else ("#", "./")) for tag, address in found
    )
    assert not full.all("link")
    assert not full.all("iframe")
    style = full.all("style")[0]["text"]
    assert "url(" not in style
    assert "@import" not in style
    assert "@font-face" not in style


def test_a_page_forbids_itself_to_load_and_to_run_anything_else(full):
    """Browsers hold to the policy, even if a name slipped in as a script."""
    policy = full.all("meta", **{"http-equiv": "Content-Security-Policy"})[0]["content"]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data: blob:"
    assert "connect-src" not in rules
    run = [script["text"] for script in full.all("script") if script.get("type") is None]
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in run]
    assert rules["script-src"].split() == [f"'sha256-{digest}'" for digest in digests]


def test_the_program_for_views_is_there_once_and_only_if_there_is_a_view(full, page_of):
    assert full.source.count("plotly.js v") == 1
    assert len(full.figures()) == 2
    without = page_of(Text(paragraph="No view."))
    assert "plotly" not in without.source.lower()
    assert len(without.source) < 20_000  # [characters]


def test_the_views_send_nothing_away(full):
    """Plotly offers to upload charts unless that is switched off."""
    program = full.all("script")[-2]["text"]
    assert "showSendToCloud: false" in program
    assert 'plotlyServerURL: ""' in program


def test_whatever_names_hold_is_shown_and_not_run(full):
    parsed = [script for script in full.all("script") if "alert(" in script["text"]]
    assert [script.get("class") for script in parsed] == ["figure"]  # JSON, which is not run
    assert "<script>alert" not in parsed[0]["text"]
    assert full.texts("h1") == [f"Road {EVIL}"]
    assert EVIL in full.texts("title")[0]
    for tag in ("dt", "dd", "p", "td", "th", "caption", "li", "figcaption", "summary", "pre"):
        assert any("alert(" in text for text in full.texts(tag)), tag
    assert full.all("img")[0]["alt"] == EVIL
    assert not [element for element in full.elements if any(n.startswith("on") for n in element)]


def test_files_are_linked_from_the_folder_of_the_page(full):
    links = [link for link in full.all("a") if link["href"].startswith("./")]
    assert [link["href"] for link in links] == [
        "./a%20b%25.laz",
        "./javascript%3A%3Cscript%3Ealert%28%27%22%26%27%29%3C/script%3E",
    ]
    assert links[0]["text"] == "a b%.laz"
    assert full.texts("td", class_="number") == ["5 B", "3 B"]


def test_a_folder_is_as_large_as_what_is_in_it(page_of, tmp_path):
    (tmp_path / "points.zarr" / "c").mkdir(parents=True)
    (tmp_path / "points.zarr" / "zarr.json").write_bytes(b"1" * 40)
    (tmp_path / "points.zarr" / "c" / "0").write_bytes(b"1" * 2)
    page = page_of(Files(files=(File(path=tmp_path / "points.zarr"),)))
    assert page.texts("td", class_="number") == ["42 B"]
    assert [link["href"] for link in page.all("a")][1:] == ["./points.zarr"]


def test_a_file_that_is_not_there_is_an_error_and_leaves_no_page(tmp_path):
    files = Files(files=(File(path="none.crg"),))
    report = Report(title="Road", sections=(Section(title="Files", blocks=(files,)),))
    with pytest.raises(OutputError, match=r"none\.crg: is listed in the report but does not exist"):
        write_report(report, tmp_path / "report.html")
    assert list(tmp_path.iterdir()) == []


def test_a_page_is_not_overwritten_unasked(tmp_path):
    write_report(Report(title="One"), tmp_path / "report.html")
    with pytest.raises(OutputError, match="exists already"):
        write_report(Report(title="Two"), tmp_path / "report.html")
    write_report(Report(title="Two"), tmp_path / "report.html", force=True)
    assert "<title>Two</title>" in (tmp_path / "report.html").read_text()


def test_the_same_report_gives_the_same_bytes(bend, tmp_path):
    pages = []
    for _ in range(2):
        write_report(everything(bend, tmp_path), tmp_path / "report.html", force=True)
        pages.append((tmp_path / "report.html").read_bytes())
    assert pages[0] == pages[1]


def test_headings_contents_and_language_serve_readers(full):
    assert full.all("html")[0]["lang"] == "en"
    levels = [int(e["tag"][1]) for e in full.elements if re.fullmatch(r"h[1-6]", e["tag"])]
    assert levels == [1, 2, 2, 2]
    contents = [link["href"] for link in full.all("a")][1:4]
    assert contents == ["#section-1", "#section-2", "#provenance"]
    ids = [element["id"] for element in full.elements if "id" in element]
    assert len(ids) == len(set(ids))
    targets = [e["href"][1:] for e in full.all("a") if e["href"].startswith("#")]
    assert set(targets) <= set(ids)
    assert all(image["alt"] for image in full.all("img"))
    assert all(button.get("aria-label") or button["text"] for button in full.all("button"))


def test_flags_are_pointed_to_at_the_top(full, page_of):
    assert full.texts("p", class_="flags") == ["⚠ 2 flags about this result: see them."]
    assert full.all("a", href="#block-1-3")
    one = page_of(Warnings(items=("lane 2 is short",)))
    assert one.texts("p", class_="flags") == ["⚠ 1 flag about this result: see it."]
    none = page_of(Warnings(items=()))
    assert none.texts("p", class_="flags") == []
    assert "Nothing is flagged." in none.texts("main")[0]


def test_provenance_is_folded_and_whole(full):
    assert "open" not in full.all("details")[0]
    assert full.texts("summary") == [f"{EVIL}: 1 step"]
    digest = hashlib.sha256(b"12345").hexdigest()
    assert full.texts("span", class_="hash") == [f"SHA-256 {digest}"]
    assert json.loads(full.all("pre")[0]["text"]) == {"name": EVIL}
    assert full.texts("li")[-2].startswith(f"{EVIL} trueterrain {__version__}")


def test_small_pictures_are_lines_and_large_ones_images(page_of):
    few = page_of(Picture(figure=plotted(), alt="few"))
    assert few.all("img")[0]["src"].startswith("data:image/svg+xml;base64,")
    assert few.all("img")[0]["width"] == "480"  # 5 inches of 96 dots
    many = page_of(Picture(figure=plotted(20_000).figure, alt="many"))
    kind, data = many.all("img")[0]["src"].split(",", 1)
    assert kind == "data:image/png;base64"
    assert int.from_bytes(base64.b64decode(data)[16:20]) == 2 * 480  # width as PNG states it


def test_paragraphs_end_at_empty_lines(page_of):
    page = page_of(Text(paragraph="One\nstill one.\n\n\nTwo."))
    assert page.texts("p")[:2] == ["One still one.", "Two."]


def test_a_section_holds_blocks_only():
    with pytest.raises(ValueError, match=r"a block must be one of Text, Table, .* got str"):
        Section(title="a", blocks=("words",))


def test_a_page_of_no_more_than_a_title_is_a_page(page_of):
    page = page_of(Report(title="Road"))
    assert page.texts("h1") == ["Road"]
    assert not page.all("nav")
    assert not page.all("details")


def test_drawing_a_page_leaves_no_figures_open(bend, page_of):
    page_of(SurfaceView(surface=bend))
    assert plt.get_fignums() == []


def test_parts_of_reports_are_there_without_heavy_modules():
    heavy = ("jinja2", "matplotlib", "numpy", "plotly", "xarray")
    code = f"import sys, trueterrain.report; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "[]"
