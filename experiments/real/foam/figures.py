"""The foam study's figures."""

from __future__ import annotations

import numpy as np
from forms import recorded
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import QUANTILE
from ertskin.diagnosis.coupon.compression import Compression
from ertskin.diagnosis.coupon.fit import CouponModel
from ertskin.hardware.measurement import Coupon

Array = NDArray[np.float64]


def slow_figure(tests: list[Compression], predictions: list[dict[str, Array]], colors: dict[str, str]) -> Figure:
    """The slow ramp and hold of every coupon, measured and predicted; below, what each prediction misses."""
    figure = Figure(figsize=(15, 5.6), layout="constrained")
    axes = figure.subplots(2, len(tests), sharex="col", sharey="row")
    for k, (test, prediction) in enumerate(zip(tests, predictions, strict=True)):
        slow = ~test.fast
        time_s = test.time_s[slow] - test.time_s[slow][0]
        axes[0, k].plot(time_s, test.force_n[slow], "k.", ms=2, label="measured")
        for name, color in colors.items():
            axes[0, k].plot(time_s, prediction[name][slow], color=color, lw=1.2, label=name)
            axes[1, k].plot(time_s, (test.force_n - prediction[name])[slow], color=color, lw=1.2)
        axes[0, k].set_title(f"coupon {k + 1}")
        axes[1, k].axhline(0, color="k", lw=0.6)
        axes[1, k].set_ylim(-1.2, 1.2)
        axes[1, k].set_xlabel("time since the slow ramp began (s)")
    axes[0, 0].set_ylabel("force (N)")
    axes[1, 0].set_ylabel("measured minus predicted (N)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def dwell_figure(coupon: Coupon, test: Compression) -> Figure:
    """The top of a fast cycle: the gap as recorded, the plates' way behind it, and the force."""
    figure = Figure(figsize=(8.5, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    third = np.flatnonzero(test.cycle == 3)
    top_s = float(test.time_s[third[np.argmax(test.sink_m()[third])]])
    time_s = np.arange(top_s - 0.3, top_s + 0.6, 0.004)
    raw = recorded(coupon, test)
    held = raw.gap_sink_m[np.searchsorted(raw.gap_time_s, time_s, side="right") - 1]
    left.plot(time_s - top_s, 1e3 * held, ".", ms=3, label="gap as recorded")
    left.plot(time_s - top_s, 1e3 * np.interp(time_s, test.gap_time_s, test.gap_sink_m), label="the plates' way")
    left.set(xlabel="time (s)", ylabel="compression (mm)")
    left.legend()
    seen = np.abs(coupon.time_s - top_s - 0.15) < 0.45
    right.plot(coupon.time_s[seen] - top_s, coupon.force_n[seen], "k.", ms=2)
    right.set(xlabel="time (s)", ylabel="force (N)")
    return figure


def parameter_figure(models: list[CouponModel]) -> Figure:
    """Every parameter fitted with its 90 % interval, coupon by coupon."""
    first = models[0]
    names = [(e, key) for e in range(len(first.effects)) for key in first.effects[e].values()]
    names = [(e, key) for e, key in names if np.isfinite(first.error(first.effects[e], key))]
    figure = Figure(figsize=(13, 5.2), layout="constrained")
    axes = figure.subplots(2, -(-len(names) // 2)).ravel()
    for axis, (e, key) in zip(axes, names, strict=False):
        for number, model in enumerate(models, start=1):
            value = getattr(model.effects[e], key)
            axis.errorbar(number, value, QUANTILE * model.error(model.effects[e], key), color="tab:red", marker=".")
        unit = first.effects[e].parameters()[key].unit
        axis.set(title=first.effects[e].name, xlabel="coupon", ylabel=f"{key} ({unit})")
        axis.set_ylim(bottom=0)
    for axis in axes[len(names) :]:
        axis.remove()
    return figure
