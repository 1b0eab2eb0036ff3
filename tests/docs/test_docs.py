"""The examples on the pages run, and print what the pages say they print.

Of each page, in order and in an empty folder: blocks of ``python``, run in one namespace; blocks of
``console``, whose lines ``$ trueterrain ...`` go through the command line. A block of ``text``
right after a block of ``python``, and the lines of a ``console`` block without ``$``, are what must
be printed. ``...`` stands for any text.
"""

import contextlib
import doctest
import io
import re
import shlex
import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

import trueterrain
from trueterrain.cli import main

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BUILT = {"_build", "gallery", "generated"}
PAGES = sorted(page for page in DOCS.rglob("*.md") if not BUILT & set(page.relative_to(DOCS).parts))
FENCE = re.compile(
    r"^(?P<fence>`{3,})(?P<language>[^`\n]*)\n(?P<code>.*?)^(?P=fence) *$",
    re.MULTILINE | re.DOTALL,
)
OUTPUT_OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def blocks(text):
    """Language, code and first line number of each fenced block."""
    found = []
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start()) + 2
        found.append((match["language"].strip(), match["code"], line))
    return found


def check_output(shown, printed, place):
    """Compare what a page shows with what was printed."""
    if not doctest.OutputChecker().check_output(shown, printed, OUTPUT_OPTIONS):
        pytest.fail(f"{place} shows\n{shown}\nbut printed was\n{printed}", pytrace=False)


def run_python(code, names, place, line):
    printed = io.StringIO()
    compiled = compile("\n" * (line - 1) + code, str(place), "exec")
    with contextlib.redirect_stdout(printed):
        exec(compiled, names)
    return printed.getvalue()


def commands(code):
    """Each command line of a console block and the output that is shown below it."""
    found = []
    for line in code.splitlines():
        if line.startswith("$ "):
            found.append([line[2:], []])
        elif found and found[-1][0].endswith("\\"):
            found[-1][0] = found[-1][0][:-1] + line
        elif found:
            found[-1][1].append(line)
    return [(command, "\n".join(shown)) for command, shown in found]


def run_command(command):
    """Run the trueterrain commands of a line, and return what they print on both streams."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        for part in command.split("&&"):
            words = shlex.split(part)
            assert words[0] == "trueterrain", f"only trueterrain can be run, got: {part}"
            try:
                main(words[1:])
            except SystemExit as stop:
                if stop.code:
                    printed.write(f"(exit code {stop.code})\n")
    return printed.getvalue()


def run_page(page):
    names = {"__name__": "__main__"}
    found = blocks(page.read_text(encoding="utf-8"))
    place = page.relative_to(ROOT)
    for index, (language, code, line) in enumerate(found):
        where = f"{place}, line {line}"
        if language == "python":
            printed = run_python(code, names, page, line)
            following = found[index + 1] if index + 1 < len(found) else ("", "", 0)
            if following[0] == "text" and following[2] <= line + code.count("\n") + 4:
                check_output(following[1], printed, where)
        elif language == "console":
            for command, shown in commands(code):
                printed = run_command(command)
                if shown.strip():
                    check_output(shown, printed, f"{where}: {command}")
                elif "(exit code" in printed or "Traceback" in printed:
                    pytest.fail(f"{where}: {command}\n{printed}", pytrace=False)
        plt.close("all")


# pages that record a scene, or make ground of many stones or points
SLOW = re.compile(r"\$ trueterrain simulate |tt\.ground\.Stones|tt\.point_blocks")


@pytest.fixture
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # `main` replaces it
    yield tmp_path
    plt.close("all")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page,
            id=str(page.relative_to(DOCS)),
            marks=[pytest.mark.slow] if SLOW.search(page.read_text()) else [],
        )
        for page in PAGES
    ],
)
def test_the_examples_of_a_page_run(page, empty_folder):
    run_page(page)


def test_the_examples_of_the_readme_run(empty_folder):
    """Its python blocks; what it shows of the shell needs files that a reader has."""
    readme = ROOT / "README.md"
    names = {"__name__": "__main__"}
    for language, code, line in blocks(readme.read_text(encoding="utf-8")):
        if language == "python":
            run_python(code, names, readme, line)


def test_a_page_that_shows_another_number_is_noticed(empty_folder, monkeypatch):
    page = empty_folder / "page.md"
    monkeypatch.setitem(sys.modules[__name__].__dict__, "ROOT", empty_folder)
    page.write_text("```python\nprint(6 * 7)\n```\n\n```text\n42\n```\n")
    run_page(page)
    page.write_text("```python\nprint(6 * 7)\n```\n\n```text\n43\n```\n")
    with pytest.raises(pytest.fail.Exception, match=r"page\.md, line 2 shows"):
        run_page(page)
    page.write_text("```console\n$ trueterrain info none.crg\n```\n")
    with pytest.raises(pytest.fail.Exception, match="exit code 2"):
        run_page(page)


def test_blocks_of_any_kind_end_where_they_end():
    page = "```{image} a.png\n:alt: a\n```\n\n```python\n1\n```\n\n````\n```\n````\n"
    assert blocks(page) == [
        ("{image} a.png", ":alt: a\n", 2),
        ("python", "1\n", 6),
        ("", "```\n", 10),
    ]


def test_every_public_name_is_in_the_reference():
    pages = "\n".join(page.read_text() for page in (DOCS / "reference").glob("*.md"))
    listed = set(re.findall(r"^ {3}(\w+)$", pages, re.MULTILINE))
    assert set(trueterrain.__all__) - {"__version__"} - listed == set()


def test_every_name_in_the_reference_can_be_had():
    """And it has a docstring, since that is all the reference shows of it."""
    for page in (DOCS / "reference").glob("*.md"):
        module = None
        for line in page.read_text().splitlines():
            if line.startswith(".. currentmodule:: "):
                module = (
                    sys.modules[line.split()[-1]]
                    if line.split()[-1] in sys.modules
                    else (__import__(line.split()[-1], fromlist=["_"]))
                )
            elif module is not None and re.fullmatch(r" {3}\w+", line):
                assert getattr(module, line.strip()).__doc__, f"{page.name}: {line.strip()}"


def test_there_are_pages_of_each_kind():
    folders = {page.relative_to(DOCS).parts[0] for page in PAGES}
    assert {"tutorials", "how-to", "explanation", "reference"} <= folders
