"""The command line: one small module per command, loaded when it is called.

Exit codes: 0 done, 2 bad input or arguments (one line on stderr; ``--debug`` adds the traceback).
"""

import sys
import warnings

import cyclopts

from trueterrain._version import __version__
from trueterrain.errors import TrueTerrainError

app = cyclopts.App(
    name="trueterrain",
    version=__version__,
    default_parameter=cyclopts.Parameter(negative=()),
    help="Ground you can trust: from measured terrain to the profile a tyre feels.",
    help_epilogue="`trueterrain COMMAND --help` shows options, units and defaults. "
    "`--debug` before the command adds tracebacks.",
)

# help is given here, since asking the command for it would import what the command needs
for _name, _help in {
    "demo": "Make a Belgian block road, extract the profile a tyre feels, and rate it.",
    "info": "Say what a file is: kind, counts, extent, CRS, and what is wrong with it.",
    "convert": "Convert surfaces, points and profiles between file formats.",
    "profile": "Extract the profile that a tyre feels along a path.",
    "iri": "International Roughness Index of profiles.",
    "plot": "Draw a surface, a point cloud or a profile.",
    "doctor": "Say what a bug report needs: versions, backends, cores.",
}.items():
    app.command(f"trueterrain.cli.{_name}:{_name}", name=_name, help=_help)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments after the program's name; default those of the process.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    warnings.showwarning = _show_warning
    try:
        app(arguments, exit_on_error=False, print_error=False)
    except (TrueTerrainError, ValueError, OSError, cyclopts.CycloptsError) as error:
        if debug:
            raise
        sys.stderr.write(f"trueterrain: error: {_one_line(error)}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.stderr.write("trueterrain: stopped; nothing was left half written\n")
        sys.exit(130)


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}."
    return " ".join(str(error).split())


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    sys.stderr.write(f"trueterrain: warning: {' '.join(str(message).split())}\n")
