"""Names of files, runs and tracks in figures, without mathematical typesetting."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from trueterrain.core.json_values import printable_text

if TYPE_CHECKING:
    from matplotlib.text import Text


def draw_names(texts: "Iterable[Text]") -> None:
    """Draw texts literally: a dollar sign in a name does not start a formula.

    Every text of a figure that contains a name of the user passes through this function: matplotlib
    typesets text between two dollar signs as mathematics, and fails if it is not.

    Parameters
    ----------
    texts : iterable of matplotlib.text.Text
        Legends, titles, notes or labels of ticks.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> title = Figure().suptitle("run $^$")
    >>> draw_names([title])
    >>> title.get_parse_math()
    False
    """
    for text in texts:
        text.set_parse_math(False)
        text.set_text(printable_text(text.get_text()))


def head_figure(figure: Any, name: str) -> None:
    """Set the title of a figure or subfigure to the name of a file or run.

    Parameters
    ----------
    figure : Figure or SubFigure
        The figure.
    name : str
        Name of a file or a run.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> figure = Figure()
    >>> head_figure(figure, "road.crg")
    >>> figure.get_suptitle()
    'road.crg'
    """
    draw_names([figure.suptitle(name, fontsize="medium")])
