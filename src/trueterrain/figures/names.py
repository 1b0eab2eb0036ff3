"""Names of files, runs and tracks in figures, as they are written."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from trueterrain.core.json_values import printable_text

if TYPE_CHECKING:
    from matplotlib.text import Text


def draw_names(texts: "Iterable[Text]") -> None:
    """Draw texts in which names stand as they are written: a dollar sign begins no formula.

    Every text of a figure that holds a name of the user's goes through here, since matplotlib sets
    what stands between two dollar signs as mathematics, and fails where it is none.

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
    """Head a figure, or a part of one, by the name of what it shows.

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
