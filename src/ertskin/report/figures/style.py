"""The quiet look all figures share: few lines, colours that stay apart for the colour-blind (Okabe and Ito 2008)."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK = "#333333"
FAINT = "#b8b8b8"
BLUE = "#0072b2"
ORANGE = "#d55e00"
GREEN = "#009e73"
PURPLE = "#8a5a83"
YELLOW = "#e69f00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, YELLOW, "#56b4e9")
MAGNITUDE_MAP = "Blues"
ERROR_MAP = "OrRd"
SURFACE_MAP = "cividis"

SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "text.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "figure.dpi": 110,
    "savefig.dpi": 110,
    "svg.fonttype": "none",
}

P = ParamSpec("P")


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draws with the shared settings, whatever the caller's own are."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(SETTINGS):
            return draw(*args, **kwargs)

    return drawn


def panels(columns: int = 1, rows: int = 1, width: float = 4.2, height: float = 3.2) -> tuple[Figure, list[Axes]]:
    """A figure free of pyplot's global state, and its axes row by row; ``width``, ``height`` in inch per panel."""
    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


def in_lines(name: str, most: int = 26) -> str:
    """A method's name in lines of at most so many characters: the names of effects are long, panels are not."""
    return textwrap.fill(name, most, break_long_words=False, break_on_hyphens=False)


def ink_on(darkness: float) -> str:
    """Text colour readable on a cell whose colour is ``darkness`` (0 to 1) along a light-to-dark map."""
    return "white" if darkness > 0.6 else INK
