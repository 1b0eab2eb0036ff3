"""Reports on paper: all that the page shows is in the PDF, whole, at its place, and the same."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from pypdf import PdfReader

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
    write_report_pdf,
)

EVIL = '<b>&amp;</i> "quoted" 100 % µ²±⁻–§'
DENSE = 200.0  # [1/inch] least density of pictures
A4 = (595.3, 841.9)  # [pt]
ROUNDED = 0.1  # [pt]
MARGIN = 51.0  # [pt]


def drawn(width=8.0, height=3.0):
    ax = Figure(figsize=(width, height)).add_subplot()
    ax.plot([0.0, 1.0], [0.0, 1.0])
    return ax


@pytest.fixture
def pdf_of(tmp_path):
    """Write blocks as the only section of a report, or a report, and read it back."""

    def write(*parts, **fields):
        if parts and isinstance(parts[0], Report):
            report = parts[0]
        else:
            report = Report(
                title="Road", sections=(Section(title="Found", blocks=parts),), **fields
            )
        write_report_pdf(report, tmp_path / "report.pdf", force=True)
        return PdfReader(tmp_path / "report.pdf")

    return write


def text_of(reader):
    """All words in order, a space between them."""
    return " ".join(" ".join(page.extract_text() for page in reader.pages).split())


def everything(surface, folder):
    """One of each kind of part, with names as bad as can be."""
    (folder / "cloud.laz").write_bytes(b"12345")
    steps = provenance.provenance_steps(
        provenance.add_step(
            xr.Dataset(),
            "grid",
            parameters={"long": "x" * 300, "name": EVIL},
            inputs=[folder / "cloud.laz"],
        )
    )
    return Report(
        title=f"Title {EVIL}",
        subtitle=f"Subtitle {EVIL}",
        headline=tuple(
            Number(
                label=f"Label {k} {EVIL}",
                value=12345.6 * k,
                unit="m²",
                verdict=verdict,
                note=f"note {k}",
            )
            for k, verdict in enumerate(("good", "bad", "unknown", None))
        ),
        sections=(
            Section(
                title=f"First {EVIL}",
                text=f"Lead {EVIL}\n\nSecond paragraph",
                blocks=(
                    Text(paragraph=f"Text {EVIL}"),
                    Table(
                        columns=(Column(label="Name"), Column(label="Height", unit="mm")),
                        rows=[("one", -1.25), ("two", None), (EVIL, 3.5)],
                        caption="Caption of the table",
                        verdicts=("good", None, "bad"),
                    ),
                    Warnings(items=(f"Warned {EVIL}", "lane 2 is short")),
                    Warnings(items=()),
                    Picture(figure=drawn(), alt="A line", caption="Caption of the picture"),
                ),
            ),
            Section(
                title="Second",
                blocks=(
                    SurfaceView(surface=surface, caption="Caption of the view"),
                    Files(files=(File(path="cloud.laz", note="all returns"),)),
                ),
            ),
        ),
        provenance={"surface": steps},
    )


@pytest.fixture(scope="module")
def full(bend, tmp_path_factory):
    folder = tmp_path_factory.mktemp("full")
    report = everything(bend, folder)
    write_report_pdf(report, folder / "one.pdf")
    return folder, report, PdfReader(folder / "one.pdf")


def test_all_that_a_report_holds_is_on_the_pages(full):
    text = text_of(full[2])
    for words in (
        f"Title {EVIL}",
        f"Subtitle {EVIL}",
        f"First {EVIL}",
        f"Lead {EVIL}",
        "Second paragraph",
        f"Text {EVIL}",
        "Caption of the table",
        "Name Height [mm] Verdict",
        "one −1.25 ✓ as required",
        "two – ",
        "✗ not as required",
        "⚠ Flagged",
        f"• Warned {EVIL}",
        "• lane 2 is short",
        "Nothing is flagged.",
        "Caption of the picture",
        "Caption of the view",
        "121 × 21 nodes are drawn: all there are.",
        "Seen from above",
        "cloud.laz all returns 5\u00a0B",
        "⚠ 2 flags about this result: see First",
        "? not known",
        "37\u00a0037 m²",
        "note 3",
        "Provenance",
        "1. grid (trueterrain",
    ):
        assert words.replace("\u00a0", " ") in text.replace("\u00a0", " "), words
    (hashed,) = full[1].provenance["surface"][0]["inputs"]
    assert hashed["sha256"] in text
    assert text.count("x") >= 300  # a long line of parameters is broken, not cut


def test_pages_are_a4_and_say_which_of_how_many_they_are(full):
    pages = full[2].pages
    for number, page in enumerate(pages, start=1):
        np.testing.assert_allclose(page.mediabox[2:], A4, rtol=0, atol=ROUNDED)
        foot = f"trueterrain {__version__} · Page {number} of {len(pages)}"
        assert foot in page.extract_text()
        assert "Title" in page.extract_text()
    assert len(pages) > 1


def test_the_file_says_what_it_is(full):
    metadata = full[2].metadata
    assert metadata.title == f"Title {EVIL}"
    assert metadata.subject == f"Subtitle {EVIL}"
    assert metadata.creator == f"trueterrain {__version__}"
    assert full[2].trailer["/Root"]["/Lang"] == "en"


def test_headings_are_listed_with_their_pages(full):
    reader = full[2]
    titles = [entry.title for entry in reader.outline]
    assert titles == [f"First {EVIL}", "Second", "Provenance"]
    for entry in reader.outline:
        page = reader.pages[reader.get_destination_page_number(entry)]
        assert entry.title in " ".join(page.extract_text().split())


def test_the_same_report_gives_the_same_bytes(full):
    folder, report, _ = full
    write_report_pdf(report, folder / "two.pdf")
    assert (folder / "one.pdf").read_bytes() == (folder / "two.pdf").read_bytes()


def test_every_letter_has_a_shape(full):
    fonts = {
        str(font["/BaseFont"])
        for page in full[2].pages
        for font in page["/Resources"]["/Font"].get_object().values()
    }
    assert all("DejaVu" in name or "Helvetica" in name for name in fonts)  # the latter is unused
    assert "\ufffd" not in text_of(full[2])


def _placed(page):
    """Name and matrix of every picture of a page."""
    found = []

    def seen(operator, operands, cm, tm):
        if operator == b"Do":
            found.append((operands[0], cm))

    page.extract_text(visitor_operand_before=seen)
    return found


def test_pictures_are_dense_and_within_the_margins(pdf_of):
    reader = pdf_of(
        Picture(figure=drawn(20.0, 4.0), alt="A line"),
        Picture(figure=drawn(4.0, 20.0), alt="A line"),
    )
    widths = []
    for page in reader.pages:
        images = page["/Resources"]["/XObject"]
        for name, (wide, _, _, high, left, low) in _placed(page):
            assert images[name]["/Width"] / (wide / 72) >= DENSE
            assert left >= MARGIN - ROUNDED
            assert left + wide <= A4[0] - MARGIN + ROUNDED
            assert low >= MARGIN - ROUNDED
            assert low + high <= A4[1] - MARGIN + ROUNDED
            widths.append(wide)
    assert len(widths) == 2


def test_heads_of_long_tables_are_repeated_with_their_units(pdf_of):
    table = Table(
        columns=(Column(label="Station", unit="m"), Column(label="Note")),
        rows=[(float(k), f"row{k}") for k in range(200)],
    )
    reader = pdf_of(table)
    assert len(reader.pages) > 2
    for page in reader.pages[:-1]:
        assert "Station [m]" in " ".join(page.extract_text().split())
    words = text_of(reader).split()
    assert [word for word in words if word.startswith("row")] == [f"row{k}" for k in range(200)]


def test_tables_of_many_columns_stay_on_the_paper_with_their_names(pdf_of):
    columns = [Column(label="Place")]
    columns += [Column(label=f"Figure{k}", unit="mm", digits=3) for k in range(30)]
    table = Table(columns=columns, rows=[["here", *(1000.0 + k for k in range(30))]])
    reader = pdf_of(table)
    right = []

    def seen(text, cm, tm, font, size):
        if text.strip():
            right.append(cm[0] * tm[4] + cm[4])

    for page in reader.pages:
        page.extract_text(visitor_text=seen)
    assert max(right) < A4[0] - MARGIN
    text = text_of(reader)
    assert text.count("Place") >= 3  # each part names the rows
    for k in range(30):
        assert f"{1000 + k}.000" in text


def test_a_word_longer_than_the_page_is_broken_not_cut(pdf_of):
    word = "abcdefghij" * 30
    text = text_of(
        pdf_of(Table(columns=(Column(label="A"), Column(label="B")), rows=[(word, word)]))
    )
    assert sum(character in "abcdefghij" for character in text) >= 600


def test_cells_and_flags_longer_than_a_page_go_on_over_it(pdf_of):
    long = " ".join(f"word{k}" for k in range(3000))
    reader = pdf_of(
        Table(columns=(Column(label="A"), Column(label="B")), rows=[("name", long)]),
        Warnings(items=(long,)),
    )
    text = text_of(reader)
    assert all(text.count(f"word{k} ") == 2 for k in range(0, 2999, 100))
    assert len(reader.pages) > 4


@pytest.mark.parametrize("lines", range(20, 60, 4))
def test_headings_and_captions_stay_with_what_they_are_of(pdf_of, lines):
    table = Table(
        columns=(Column(label="A"),), rows=[(f"row{k}",) for k in range(8)], caption="Caption of it"
    )
    picture = Picture(figure=drawn(), alt="A line", caption="Caption of the line")
    filling = Section(title="Filling", blocks=[Text(paragraph="word")] * lines)
    for block in (table, picture):
        named = Section(title="Heading of it", blocks=(block,))
        reader = pdf_of(Report(title="Road", sections=(filling, named)))
        (page,) = [page for page in reader.pages if "Heading of it" in page.extract_text()]
        if block is table:
            assert "Caption of it" in page.extract_text()
            assert "row7" in page.extract_text()
        else:
            assert "Caption of the line" in page.extract_text()
            assert len(_placed(page)) == 1


def test_a_table_without_rows_shows_its_head(pdf_of):
    assert "Lane [m]" in text_of(pdf_of(Table(columns=(Column(label="Lane", unit="m"),), rows=[])))


def test_a_report_of_no_more_than_a_title_is_a_page(pdf_of):
    reader = pdf_of(Report(title="Only " + 40 * "long "))
    assert len(reader.pages) == 1
    assert "Page 1 of 1" in text_of(reader)
    assert "…" in text_of(reader)  # the foot is cut where the page ends, and says so


def test_an_existing_file_stays_without_force(tmp_path):
    (tmp_path / "report.pdf").write_text("mine")
    with pytest.raises(OutputError, match=r"report\.pdf: exists already"):
        write_report_pdf(Report(title="One"), tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_text() == "mine"


def test_a_file_that_is_missing_leaves_nothing(tmp_path):
    files = Section(title="Files", blocks=(Files(files=(File(path="none.laz"),)),))
    with pytest.raises(OutputError, match=r"none\.laz: is listed in the report but does not exist"):
        write_report_pdf(Report(title="One", sections=(files,)), tmp_path / "report.pdf")
    assert list(tmp_path.iterdir()) == []
