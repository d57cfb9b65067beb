"""Errors of contacts anywhere: over the sheet, against force, and against the distance of contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ertskin.report.figures.style import BLUE, GREEN, INK, MAGNITUDE_MAP, ORANGE, panels, styled

if TYPE_CHECKING:
    from ertskin.evaluation.contact_outcome import ContactOutcome

COLOURS = {1: BLUE, 2: ORANGE, 3: GREEN}
"""Of frames by their number of contacts; more than three in ink."""


@styled
def place_error_map(outcome: ContactOutcome) -> Figure:
    """Every true contact at its place in mm, coloured by how far off it was said; crosses: never found."""
    figure, (axes,) = panels(width=5.2, height=4.4)
    frame, true, _ = outcome.pairs
    place = 1e3 * outcome.true_m[frame, true]
    high = max(0.5, float(np.quantile(outcome.place_error_mm, 0.95)))
    drawn = axes.scatter(
        place[:, 0], place[:, 1], c=outcome.place_error_mm, cmap=MAGNITUDE_MAP, vmin=0, vmax=high, s=22
    )
    found = np.zeros(outcome.true_n.shape, dtype=bool)
    found[frame, true] = True
    missed = 1e3 * outcome.true_m[np.isfinite(outcome.true_m).all(axis=-1) & ~found]
    if len(missed):
        axes.scatter(missed[:, 0], missed[:, 1], marker="x", color=ORANGE, label="missed")
        axes.legend(loc="upper right")
    axes.set(xlabel="x / mm", ylabel="y / mm", aspect="equal")
    figure.colorbar(drawn, label="location error / mm", extend="max")
    return figure


@styled
def error_by_force(outcome: ContactOutcome) -> Figure:
    """Location and force error of every contact against its true force."""
    figure, (place, force) = panels(2, width=3.8, height=3.4)
    frame, true, _ = outcome.pairs
    count = outcome.true_count[frame]
    for number in np.unique(count):
        rows = count == number
        at = outcome.true_n[frame, true][rows]
        colour = COLOURS.get(int(number), INK)
        place.semilogy(at, np.maximum(outcome.place_error_mm[rows], 1e-3), ".", color=colour, label=f"{number} at once")
        force.plot(at, outcome.force_error_n[rows], ".", color=colour)
    place.set(xlabel="true force / N", ylabel="location error / mm")
    force.set(xlabel="true force / N", ylabel="force error / N")
    figure.legend(loc="outside upper center", ncols=4)
    return figure


@styled
def error_by_distance(outcome: ContactOutcome) -> Figure:
    """Location error of frames with several contacts against the least distance between two of them."""
    figure, (axes,) = panels(width=5.2, height=3.4)
    frame = outcome.pairs[0]
    for number in np.unique(outcome.true_count[outcome.true_count > 1]):
        rows = outcome.true_count[frame] == number
        right = outcome.said_count[frame] == number
        apart = 1e3 * outcome.least_distance_m[frame]
        error = np.maximum(outcome.place_error_mm, 1e-3)
        colour = COLOURS.get(int(number), INK)
        axes.semilogy(apart[rows & right], error[rows & right], ".", color=colour, label=f"{number} contacts")
        axes.semilogy(apart[rows & ~right], error[rows & ~right], "x", color=colour)
    axes.set(xlabel="least distance of two contacts / mm", ylabel="location error / mm")
    axes.legend(title="crosses: wrong number", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
