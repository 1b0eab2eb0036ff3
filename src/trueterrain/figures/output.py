"""Output of figures to files, whole or not at all."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trueterrain.core import require_writable, whole_output

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Endings that can be written, with the metadata that omit the date: the same figure gives the
#: same file.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}

_MAX_RESOLUTION = 2400.0  # [1/inch] resolution of printers


def save_figure(
    figure: "Figure | Axes", path: str | Path, *, force: bool = False, resolution: float = 160.0
) -> None:
    """Write a figure as SVG, PDF or PNG, according to the ending of the name.

    Parameters
    ----------
    figure : Figure or Axes
        The figure, or any axes of it.
    path : str or Path
        File to write: .svg, .pdf or .png.
    force : bool
        Replace an existing file.
    resolution : float
        Dots per inch of a PNG file and of images inside the others.

    Raises
    ------
    ValueError
        If the ending is not one of these, or the resolution is not greater than 0 and at most 2400.
    OutputError
        If the file exists and `force` is false, or its folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.figures import profiles
    >>> from trueterrain.core.schemas import make_profile
    >>> ax = profiles(make_profile([0.0, 1.0, 2.0], [0.0, 0.01, 0.0]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_figure(ax, Path(folder) / "bump.svg")
    ...     (Path(folder) / "bump.svg").stat().st_size > 1000
    True
    """
    import matplotlib as mpl

    ending = _figure_ending(path)
    if not 0 < resolution <= _MAX_RESOLUTION:
        message = (
            f"resolution must be greater than 0 and at most {_MAX_RESOLUTION:g} dots per inch, "
            f"got {resolution:g}."
        )
        raise ValueError(message)
    whole: Any = figure if hasattr(figure, "savefig") else figure.get_figure(root=True)
    with (
        whole_output(path, force=force) as temporary,
        mpl.rc_context({"svg.hashsalt": "trueterrain"}),
    ):
        whole.savefig(temporary, dpi=resolution, metadata=_METADATA[ending])


def require_picture(
    path: str | Path, *, force: bool = False, inputs: Iterable[str | Path] = ()
) -> None:
    """Raise an error if a figure cannot be written, before the work for it begins.

    Parameters
    ----------
    path : str or Path
        File to write: .svg, .pdf or .png.
    force : bool
        Whether an existing file may be replaced.
    inputs : iterable of str or Path
        Input files; none of them is replaced, not even with `force`.

    Raises
    ------
    ValueError
        If the ending is not one of these.
    OutputError
        As by `trueterrain.core.require_writable`.

    Examples
    --------
    >>> require_picture("road.bmp")
    Traceback (most recent call last):
    ValueError: road.bmp: a figure ends in .png, .svg, .pdf, got '.bmp'.
    """
    _figure_ending(path)
    require_writable(path, force=force, inputs=inputs)


def _figure_ending(path: str | Path) -> str:
    ending = Path(path).suffix.lower()
    if ending not in _METADATA:
        message = f"{path}: a figure ends in {', '.join(_METADATA)}, got {ending or 'no ending'!r}."
        raise ValueError(message)
    return ending
