"""Sheet resistance of the piezoresistive pair against stress, and the polynomial through it (paper Fig. 4)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.report.figures.style import BLUE, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def specimen(
    stress_pa: Array, sheet_resistance_ohm_sq: Array, fit_stress_pa: Array, fit_sheet_resistance_ohm_sq: Array
) -> Figure:
    """Compressometer points (N,) and the fifth-order polynomial (M,)."""
    figure, (axes,) = panels()
    axes.plot(1e-3 * stress_pa, 1e-3 * sheet_resistance_ohm_sq, ".", ms=5, mew=0, color=BLUE, alpha=0.5, label="test")
    axes.plot(1e-3 * fit_stress_pa, 1e-3 * fit_sheet_resistance_ohm_sq, color=ORANGE, label="fifth-order polynomial")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("stress / kPa")
    axes.set_ylabel("sheet resistance / (kΩ/sq)")
    axes.legend()
    return figure
