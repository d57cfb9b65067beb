"""All readings at rest, measured and modelled, before and after fitting the contact resistances (paper Fig. 7)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def contact_resistance_fit(measured_v: Array, initial_v: Array, fitted_v: Array) -> Figure:
    """Readings (R,) in order; left the readings, right their error, above with the guess, below fitted."""
    figure, (a, b, c, d) = panels(2, 2, width=4.4, height=2.3)
    number = np.arange(measured_v.size)
    rows = ((a, b, "guessed contact resistances", initial_v), (c, d, "fitted contact resistances", fitted_v))
    for left, right, title, model_v in rows:
        error_v = measured_v.ravel() - model_v.ravel()
        left.plot(number, measured_v.ravel(), color=BLUE, lw=0.4, label="measured")
        left.plot(number, model_v.ravel(), color=ORANGE, lw=0.4, alpha=0.7, label="model")
        left.set_title(title)
        left.set_ylabel("potential / V")
        right.plot(number, 1e3 * error_v, color=BLUE, lw=0.4)
        right.set_title(f"error: {1e3 * np.sqrt(np.mean(error_v**2)):.3g} mV rms")
        right.set_ylabel("measured − model / mV")
    a.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, handlelength=1.2)
    c.set_xlabel("reading")
    d.set_xlabel("reading")
    return figure
