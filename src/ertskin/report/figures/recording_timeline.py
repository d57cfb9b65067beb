"""The recording along its time: the force applied, and how far the readings lie from those at rest."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.physics.history import Phase
from ertskin.report.figures.style import BLUE, ORANGE, panels, styled

Array = NDArray[np.float64]


@styled
def recording_timeline(
    time_s: Array, force_n: Array, change_v: Array, phase: NDArray[np.uint8], title: str = ""
) -> Figure:
    """Frames (T,): total force, and rms change (T,) of the readings against the first rest frame."""
    figure, (above, below) = panels(1, 2, width=8.4, height=1.5)
    minutes = time_s / 60
    rest = phase == Phase.REST
    above.plot(minutes, force_n, color=BLUE, lw=0.7)
    above.set_ylabel("force / N")
    above.set_title(title)
    above.set_xticklabels([])
    below.plot(minutes, 1e3 * change_v, color=BLUE, lw=0.7)
    below.plot(minutes[rest], 1e3 * change_v[rest], ".", ms=6, mew=0, color=ORANGE, label="at rest")
    below.set_yscale("symlog", linthresh=1.0)
    below.set_ylabel("change, rms / mV")
    below.set_xlabel("time / min")
    below.legend(loc="lower right")
    return figure
