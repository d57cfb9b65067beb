"""The film study's figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from film import PRESSES, Film
from forms import Fitted
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

SIDE = 4


def place_figure(films: Sequence[Film], models: Sequence[Fitted]) -> Figure:
    """Resistance by stress, press by press; the same against the stress times its press's sensitivity; the presses'
    sensitivities at three forces, and as the grid that they are."""
    figure = Figure(figsize=(15, 4), layout="constrained")
    raw, scaled, alike, grid = figure.subplots(1, 4)
    film, model = films[-1], models[-1]
    order = np.argsort(np.argsort(model.log_sensitivity))
    for press in range(PRESSES):
        mine = film.loaded & (film.press == press)
        color = _color(int(order[press]))
        stress, factor = film.stress_pa[mine], np.exp(model.log_sensitivity[press])
        raw.loglog(stress, film.resistance[mine], ".", ms=2, color=color)
        scaled.loglog(stress * factor, film.resistance[mine], ".", ms=2, color=color)
    for axis in (raw, scaled):
        axis.xaxis.set_minor_formatter(NullFormatter())
    raw.set(xlabel="stress (Pa)", ylabel="resistance (unit not documented)", title=f"{film.force_n} N: 16 presses")
    scaled.set(xlabel="stress times the press's sensitivity (Pa)", title="one law")
    for other, one in zip(films[:-1], models[:-1], strict=True):
        alike.plot(model.log_sensitivity, one.log_sensitivity, "o", ms=4, label=f"{other.force_n} N")
    ends = np.array([model.log_sensitivity.min(), model.log_sensitivity.max()])
    alike.plot(ends, ends, color="0.6", lw=0.8)
    alike.set(xlabel=f"log sensitivity at {film.force_n} N", ylabel="at the other forces", title="press by press")
    alike.legend()
    mean = np.mean([one.log_sensitivity for one in models], axis=0).reshape(SIDE, SIDE)
    shown = grid.imshow(mean, cmap="viridis")
    figure.colorbar(shown, ax=grid, label="mean log sensitivity")
    grid.set(title="presses in rows of four", xticks=[], yticks=[])
    return figure


def _color(rank: int) -> tuple[float, float, float]:
    share = float(rank) / (PRESSES - 1)
    return (0.15 + 0.8 * share, 0.3, 0.85 - 0.75 * share)


def within_figure(films: Sequence[Film], models: Sequence[Fitted]) -> Figure:
    """What a static law with each press's sensitivity leaves, over the time since the press began, and ended."""
    figure = Figure(figsize=(12, 3.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for film, model, color in zip(films, models, ("tab:green", "tab:orange", "tab:blue"), strict=True):
        left = film.log_resistance - model(film, model.log_sensitivity)
        for axis, pressed in zip(axes, (True, False), strict=True):
            since = np.concatenate([_since(film, k, pressed) for k in range(PRESSES)])
            value = np.concatenate([left[_rows(film, k, pressed)] for k in range(PRESSES)])
            times = np.arange(0.1, 1.6 if pressed else min(4.4, float(np.quantile(since, 0.98))), 0.1)
            middle = [np.median(value[np.abs(since - at) < 0.06]) for at in times]
            axis.plot(since, value, ".", ms=1, color=color, alpha=0.25)
            axis.plot(times, middle, color=color, label=f"{film.force_n} N, median")
    axes[0].set(xlabel="time since the press began (s)", ylabel="log resistance over the law's", xlim=(0, 1.7))
    axes[0].set_ylim(-0.4, 0.5)
    axes[1].set(xlabel="time since it ended (s)", xlim=(0, 4.5))
    axes[0].legend()
    return figure


def _rows(film: Film, press: int, pressed: bool) -> NDArray[np.intp]:
    mine = np.flatnonzero(film.press == press)
    on = mine[film.loaded[mine]]
    return on if pressed else mine[mine > on[-1]]


def _since(film: Film, press: int, pressed: bool) -> NDArray[np.float64]:
    rows = _rows(film, press, pressed)
    return film.time_s[rows] - film.time_s[rows[0]] if len(rows) else np.zeros(0)
