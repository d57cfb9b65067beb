"""The tank study's figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from nulls import displaced, largest

from ertskin.diagnosis.tank.placement import TOLERANCE


def place_figure(said: dict[str, Any], photographed: dict[str, Any]) -> Figure:
    """Shifts found along the rim, and those that the photographs make one expect, frame by frame."""
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    axes = figure.subplots(1, len(said), sharey=True)
    for axis, (tank, one) in zip(axes, said.items(), strict=True):
        for k, row in enumerate(photographed[tank]):
            axis.plot(row["expected"], "-", color="0.6", lw=1, label="photographs, on the disk" if k == 0 else None)
        axis.plot(one["shift"], "o", color="tab:red", ms=5, label="found by the readings")
        for side in (-TOLERANCE, TOLERANCE):
            axis.axhline(side, color="k", lw=0.6, ls=":")
        axis.set(title=tank, xlabel="electrode")
    axes[0].set_ylabel("shift along the rim, over the radius")
    axes[0].legend()
    return figure


def simulated_figure(cases: list[dict[str, Any]]) -> Figure:
    """The largest shift found, two standard errors off, against the largest true one, kind by kind."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axis = figure.subplots()
    for number, kind in enumerate(dict.fromkeys(one["kind"] for one in cases)):
        mine = [one for one in cases if one["kind"] == kind]
        true = [np.abs(one["true_shift"]).max() for one in mine]
        axis.plot(true, [largest(one) for one in mine], ".", color=f"C{number}", label=kind)
        named = [(t, largest(one)) for t, one in zip(true, mine, strict=True) if displaced(one)]
        if named:
            axis.plot(*np.transpose(named), "o", mfc="none", mec="0.3", ms=7, mew=0.5)
    axis.axhline(TOLERANCE, color="k", lw=0.8, ls=":")
    axis.set(xlabel="largest true shift, over the radius", ylabel="largest found, two standard errors taken off")
    axis.set_title("circled: named", fontsize="medium")
    axis.legend(fontsize="small")
    return figure
