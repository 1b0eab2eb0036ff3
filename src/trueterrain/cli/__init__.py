"""The command line: one small module per command, loaded when it is called.

Exit codes: 0 done, 2 bad input or arguments (one line on stderr; ``--debug`` adds the traceback).
"""

import signal
import sys
import threading
import warnings
from contextlib import suppress

import cyclopts

from trueterrain._version import __version__
from trueterrain.cli._console import abandon_streams, in_words, prepare_streams, write_note
from trueterrain.cli._numbers import require_usable
from trueterrain.core.errors import TrueTerrainError

# exit codes by which shells name a program that nobody listened to any more, or that was ended
_PIPE_CLOSED, _TERMINATED = 141, 143

_COMMANDS = {
    "calibrate": "Find how the scanner sits, and its clock, from passes over the same ground.",
    "compare": "Say how well profiles, or surfaces, agree with each other and a reference.",
    "convert": "Convert surfaces, points and profiles between file formats.",
    "demo": "Survey a Belgian block road in two lanes, all the way to a report.",
    "doctor": "Say what a bug report needs: versions, backends, cores.",
    "evenness": "RMS of profiles in bands of wavelength, and under a straightedge.",
    "event": "Design an excitation event: cleats that shake a vehicle in its modes.",
    "filter": "Take waves out of profiles: low, high or band pass, moving average.",
    "georeference": "Turn a recorded run into points: every return at its own time.",
    "grid": "Grid recorded runs, or points, to a surface with its standard deviation.",
    "info": "Say what a file is: kind, counts, extent, CRS, and what is wrong with it.",
    "init": "Print complete settings to begin with, of a survey or a scene.",
    "iri": "International Roughness Index of profiles.",
    "merge": "Bring passes over the same ground into agreement: one ground of many lanes.",
    "plate": "Design a calibration plate: cleats of known profile, the reference of tests.",
    "plot": "Draw a surface, a point cloud, a profile, a recorded run or a navigation.",
    "profile": "Extract the profile that a tyre feels along a path.",
    "psd": "Power spectral density of profiles, with road class, Gd(n0) and waviness.",
    "rn": "Ride Number of profiles.",
    "run": "Take a whole survey from recorded runs to ground, profiles and a report.",
    "simulate": "Drive a virtual profiler over known ground and record its runs.",
    "verify": "Test how true a profiler is: standing, driving, over distance; certify it.",
}


def command_line(called: str | None = None) -> cyclopts.App:
    """Build the command line.

    Parameters
    ----------
    called : str, optional
        The command that is called. It explains itself; the others are listed with the words above,
        since asking them would import all that they need.

    Returns
    -------
    cyclopts.App
        The application.
    """
    app = cyclopts.App(
        name="trueterrain",
        version=__version__,
        default_parameter=cyclopts.Parameter(negative=(), validator=require_usable),
        suppress_keyboard_interrupt=False,  # main says what became of the output
        help="Ground you can trust: from measured terrain to the profile a tyre feels.",
        help_epilogue="`trueterrain COMMAND --help` shows options, units and defaults. "
        "`--debug` adds tracebacks to errors.",
    )
    for name, text in _COMMANDS.items():
        listed = {} if name == called else {"help": text}
        app.command(f"trueterrain.cli.{name}:{name}", name=name, **listed)
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
        # end as `timeout` and batch systems ask for it, but with half outputs taken away
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(_TERMINATED))
    try:
        command_line(called)(arguments, exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads the output has seen enough, as `head` does
        _exit_with(_PIPE_CLOSED)
    except (TrueTerrainError, ValueError, OSError, MemoryError, cyclopts.CycloptsError) as error:
        if debug:
            raise
        _exit_with(2, f"trueterrain: error: {in_words(error)}")
    except KeyboardInterrupt:
        _exit_with(130, "trueterrain: stopped; nothing was left half written")


def _exit_with(code: int, text: str = "") -> None:
    """Exit with a last word, if anybody hears it."""
    with suppress(OSError):
        if text:
            write_note(text)
    abandon_streams()
    sys.exit(code)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    write_note(f"trueterrain: warning: {' '.join(str(message).split())}")
