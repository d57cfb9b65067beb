"""A coupon's test drawn: what was measured, what the elastic curve and the effects make of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.coupon.compression import Compression
from ertskin.diagnosis.coupon.fit import CouponModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def coupon_figure(
    test: Compression, out: NDArray[np.bool_], elastic: CouponModel, model: CouponModel, name: str = "with effects"
) -> Figure:
    """Force over time and misfit over time; the part held out (N,) is shaded."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.2, 5.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(test.time_s, test.force_n, "k.", ms=2, label="measured")
    for fitted, color, label in ((elastic, "tab:gray", "elastic alone"), (model, "tab:red", name)):
        force = fitted.force_n(test)
        above.plot(test.time_s, force, color=color, lw=0.9, label=label)
        below.plot(test.time_s, test.force_n - force, color=color, lw=0.9)
    for axis in (above, below):
        shade(axis, test, out)
    above.set_ylabel("force (N)")
    above.legend()
    below.set(xlabel="time (s)", ylabel="measured minus model (N)")
    return figure


def shade(axis: Axes, test: Compression, out: NDArray[np.bool_]) -> None:
    """Mark when the samples ``out`` (N,) were taken."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(int), [0]])))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        axis.axvspan(test.time_s[first], test.time_s[end - 1], color="tab:blue", alpha=0.1, lw=0)
