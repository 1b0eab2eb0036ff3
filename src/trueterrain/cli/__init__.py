"""The command line: one module per command, imported when the command is called.

Exit codes: 0 done, 2 invalid input or arguments (one line on stderr; ``--debug`` adds the
traceback). The page on the command line lists all of them.
"""

import signal
import sys
import threading
import warnings
from contextlib import suppress

import cyclopts

from trueterrain._version import __version__
from trueterrain.cli._console import abandon_streams, error_text, prepare_streams, write_note
from trueterrain.cli._options import convert_value, rename_options
from trueterrain.core.errors import TrueTerrainError

# exit codes that shells give a program whose reader has closed the pipe, or that got SIGTERM
_PIPE_CLOSED, _TERMINATED = 141, 143

# groups in the order of --help, with their commands and one line on each
_GROUPS = {
    "Start": {
        "demo": "Simulate a survey of two lanes, and process it up to the report.",
        "info": "Show kind, counts, extent, CRS and problems of files.",
        "init": "Print settings to start from: survey, scene or accuracy test.",
        "convert": "Convert surfaces, points and profiles between file formats.",
    },
    "Survey": {
        "run": "Process a survey: runs to surfaces, profiles and a report.",
        "georeference": "Convert a recorded run to georeferenced points.",
        "calibrate": "Estimate boresight, lever arm and clock of the scanner.",
        "merge": "Bring passes over the same ground into agreement.",
        "grid": "Grid runs or points to a surface with standard deviations.",
    },
    "Profile": {
        "profile": "Extract the profile that a tyre feels along a path.",
        "iri": "International Roughness Index of profiles.",
        "rn": "Ride Number of profiles.",
        "psd": "Power spectral density, road class, Gd(n0) and waviness.",
        "evenness": "RMS in bands of wavelength, and rolling straightedge.",
        "filter": "Filter profiles by wavelength: low, high or band pass.",
        "compare": "Agreement of profiles or surfaces, also with a reference.",
    },
    "Accuracy": {
        "event": "Design an excitation event that excites the modes of a vehicle.",
        "plate": "Design a calibration plate with cleats of known profile.",
        "verify": "Measure the accuracy of a profiler, and write a certificate.",
    },
    "Simulate": {
        "simulate": "Simulate recorded runs whose true ground is known.",
    },
    "Other": {
        "plot": "Draw a surface, points, profiles, a recorded run or navigation.",
        "doctor": "Show versions, backends and cores for a bug report.",
    },
}
_COMMANDS = {name: text for commands in _GROUPS.values() for name, text in commands.items()}


def command_line(called: str | None = None) -> cyclopts.App:
    """Build the command line.

    Parameters
    ----------
    called : str, optional
        The command that is called: its help comes from its own module. The others are listed with
        the texts above, since their own would import their modules and make ``--help`` slow.

    Returns
    -------
    cyclopts.App
        The application.
    """
    app = cyclopts.App(
        name="trueterrain",
        version=__version__,
        default_parameter=cyclopts.Parameter(negative=(), converter=convert_value),
        suppress_keyboard_interrupt=False,  # main reports the state of the output
        help="Terrain measurement: from recorded runs to surfaces, profiles and roughness.",
        help_epilogue="`trueterrain COMMAND --help` shows options, units and defaults. "
        "`--debug` adds tracebacks to errors.",
    )
    for number, (title, commands) in enumerate(_GROUPS.items()):
        group = cyclopts.Group(title, sort_key=number)
        for name, text in commands.items():
            listed = {} if name == called else {"help": text}
            app.command(
                f"trueterrain.cli.{name}:{name}",
                name=name,
                group=group,
                sort_key=list(commands).index(name),
                **listed,
            )
    for flag in (*app.help_flags, *app.version_flags):
        app[flag].group = group
    return app


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments after the program's name; default those of the process.
    """
    prepare_streams()
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    called = next((argument for argument in arguments if argument in _COMMANDS), None)
    warnings.showwarning = _show_warning
    if threading.current_thread() is threading.main_thread():
        # `timeout` and batch systems send SIGTERM: exit normally, so that partial output is removed
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(_TERMINATED))
    try:
        arguments, notes = rename_options(called or "", arguments)
        for note in notes:
            write_note(f"trueterrain: note: {note}")
        command_line(called)(arguments, exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        _exit_with(_PIPE_CLOSED)
    except SystemExit as stop:
        # rich, which prints the help, exits with 1 when the reader has closed the pipe
        if isinstance(stop.__context__, BrokenPipeError):
            _exit_with(_PIPE_CLOSED)
        raise
    except (TrueTerrainError, ValueError, OSError, MemoryError, cyclopts.CycloptsError) as error:
        if debug:
            raise
        _exit_with(2, f"trueterrain: error: {error_text(error)}")
    except KeyboardInterrupt:
        _exit_with(130, "trueterrain: stopped; nothing was left half written")


def _exit_with(code: int, text: str = "") -> None:
    """Exit with a last line on stderr, if stderr is still open."""
    with suppress(OSError):
        if text:
            write_note(text)
    abandon_streams()
    sys.exit(code)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    write_note(f"trueterrain: warning: {' '.join(str(message).split())}")
