"""Directive ``command-line``: reference of all commands, from their help."""

import re
from typing import Any

import cyclopts
from cyclopts.docs.rst import generate_rst_docs
from cyclopts.ext.sphinx import CycloptsDirective, DirectiveOptions
from sphinx.application import Sphinx

from trueterrain.cli import command_line

_EXAMPLE = re.compile(r"^Example: `?(.+?)`?$", re.MULTILINE)


class CommandLine(CycloptsDirective):
    """Reference of all commands; each is imported, for its own help."""

    required_arguments = 0

    def run(self) -> list[Any]:
        """Nodes of the documentation."""
        options = DirectiveOptions(heading_level=2, skip_preamble=True)
        return self._create_nodes(_reference_text(), options)


def _reference_text() -> str:
    """Reference of all commands as reStructuredText."""
    app = cyclopts.App(name="trueterrain", default_parameter=cyclopts.Parameter(negative=()))
    for name in command_line():
        if not name.startswith("-"):
            app.command(f"trueterrain.cli.{name}:{name}", name=name)
    text = generate_rst_docs(app, heading_level=2, no_root_title=True, skip_preamble=True)
    without_contents = text.split(".. _cyclopts-", 1)[1]
    examples = _EXAMPLE.sub(r"Example:\n\n::\n\n    \1\n", ".. _cyclopts-" + without_contents)
    return examples.replace(" [Default: ``False``]", "")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
