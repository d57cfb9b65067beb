"""A tank's findings drawn: the electrodes' errors and the maps of what changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.path import Path

from ertskin.diagnosis.tank.electrode_error import ElectrodeErrors
from ertskin.diagnosis.tank.inclusions import InclusionMap
from ertskin.physics.sensor import Sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIXELS = 200
STRONGEST = np.log(30.0)


def electrode_figure(before: ElectrodeErrors, after: ElectrodeErrors | None = None) -> Figure:
    """Rms error of every electrode's potential in millivolt, the ones named in red, and what is left when mended."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 3.2), layout="constrained")
    axis = figure.subplots()
    number = np.arange(len(before.rms_v))
    color = ["tab:red" if e in before.named else "tab:gray" for e in number]
    axis.bar(number, 1e3 * before.rms_v, color=color)
    if after is not None and before.named:
        axis.plot(number, 1e3 * after.rms_v, "k_", ms=7, label="with the gains and offsets named")
        axis.legend()
    axis.set(xlabel="electrode", ylabel="error no network explains (mV)")
    return figure


def map_figure(sensor: Sensor, maps: list[InclusionMap], frames: list[int]) -> Figure:
    """The maps, on a scale from a thirtieth to thirty times the empty tank's conductivity."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6 * len(maps) + 1.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(maps), squeeze=False)[0]
    for axis, one, frame in zip(axes, maps, frames, strict=True):
        image = draw_map(axis, sensor, one)
        axis.set_title(f"frame {frame}")
    bar = figure.colorbar(image, ax=list(axes), label="conductivity over the empty tank's")
    ticks = (0.1, 0.3, 1, 3, 10)
    bar.set_ticks([float(np.log(t)) for t in ticks], labels=[f"{t:g}" for t in ticks])
    return figure


def draw_map(axis: Axes, sensor: Sensor, one: InclusionMap):  # type: ignore[no-untyped-def]
    """One map inside the sheet's outline, in millimetre; returns the image for a colour bar."""
    (left, low), (right, high) = sensor.extent_m
    x, y = np.meshgrid(np.linspace(left, right, PIXELS), np.linspace(low, high, PIXELS))
    place = np.stack([x, y], axis=-1).reshape(-1, 2)
    value = np.where(Path(sensor.outline_m).contains_points(place), one.at(place), np.nan).reshape(x.shape)
    image = axis.imshow(
        value,
        origin="lower",
        extent=(1e3 * left, 1e3 * right, 1e3 * low, 1e3 * high),
        cmap="RdBu",
        vmin=-STRONGEST,
        vmax=STRONGEST,
    )
    axis.plot(*1e3 * np.vstack([sensor.outline_m, sensor.outline_m[:1]]).T, color="k", lw=0.8)
    axis.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    return image
