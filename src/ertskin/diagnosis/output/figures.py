"""The figures of a skin's diagnosis: where the misfit sat, before and after; what can't be drawn is left out."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import FieldMap
from ertskin.diagnosis.judge.axis_tests import AxisTest
from ertskin.diagnosis.judge.result import Drawing, DrawnFindings, Findings
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.report.figures.image import save_png
from ertskin.report.figures.style import BLUE, ERROR_MAP, GREEN, INK, ORANGE, panels, styled
from ertskin.report.figures.taxel_map import draw_taxels
from ertskin.report.words import words_of

Array = NDArray[np.float64]

FOLDER = "figures"
PRIOR = 0.02
"""Standard deviation, beforehand, of the relative change of conductance at a node of the grid."""
PHASES = ((1, "^", "loading", BLUE), (2, "o", "hold", GREEN), (3, "v", "unloading", ORANGE))


@dataclass(frozen=True)
class Drawn:
    """A figure on disk, with its title and caption."""

    title: str
    caption: str
    path: Path

    def as_builtins(self) -> dict[str, str]:
        """As ``diagnosis.json`` wants it; the file is named from the folder of that."""
        return {"title": self.title, "caption": self.caption, "file": f"{FOLDER}/{self.path.name}"}


def write_figures(folder: Path, findings: Findings) -> list[Drawn]:
    """Every figure the findings allow, as PNG in ``folder/figures``; those of an earlier diagnosis go."""
    shutil.rmtree(folder / FOLDER, ignore_errors=True)
    written = []
    for title, caption, draw in figures(findings):
        path = folder / FOLDER / f"{re.sub('[^a-z0-9]+', '_', title.lower()).strip('_')}.png"
        written.append(Drawn(title, caption, save_png(draw(), path)))
    return written


def figures(findings: Findings) -> Iterator[Drawing]:
    """(title, caption, what draws it) of every figure the findings allow."""
    if isinstance(findings, DrawnFindings):
        yield from findings.drawings
    if findings.evidence is not None and _mapped(findings):
        yield (
            "What was found over the sheet",
            "By how much a property named differs from its calibrated value; blank where the recording doesn't tell. "
            "Small squares: electrodes.",
            lambda: _fields(findings),
        )
    evidence, held = findings.evidence, findings.held
    if evidence is not None and findings.residual_before is not None and held is not None:
        yield from _of_residuals(findings, np.asarray(evidence.history[held].touched.any(axis=1)))
    if findings.baseline is not None and evidence is not None:
        if findings.baseline.force_linear is not None:
            yield (
                "Force against depth",
                "Load cell against the force stage: residuals of a linear pad, and of the pad with the effects named.",
                lambda: _force_depth(findings),
            )
        yield ("The specimen", "Sheet resistance of the specimen against stress.", lambda: _specimen(findings))


def _of_residuals(findings: Findings, touched: NDArray[np.bool_]) -> Iterator[Drawing]:
    if touched.any():
        yield (
            "Misfit over the sheet",
            "Rms residual of held-out presses in units of the noise, by place, before and after. "
            "Small squares: electrodes.",
            lambda: _places(findings, touched),
        )
        yield (
            "Misfit against force",
            "The same against the contact force, loading and unloading apart. The line is the noise.",
            lambda: _forces(findings),
        )
    if findings.selection is not None:
        yield (
            "Where the sheet would have to differ",
            "The mean misfit of held-out frames before, projected back on the resting sheet: the relative change of "
            "conductance that would explain it best. Small squares: electrodes.",
            lambda: _projected(findings, touched),
        )
    if any(_by_electrode(tests) for tests in (findings.tests_before, findings.tests_after)):
        yield (
            "Misfit by electrode",
            "Rms residual of the readings at each electrode, before and after. The line is the noise.",
            lambda: _electrodes(findings),
        )


def _rms(residual: Array) -> Array:
    return np.asarray(np.sqrt((residual**2).mean(axis=1)))


@styled
def _places(findings: Findings, touched: NDArray[np.bool_]) -> Figure:
    assert findings.evidence is not None
    assert findings.held is not None
    place_m = findings.evidence.history[findings.held].contact_m[touched, 0]
    unique_m, number = np.unique(np.round(place_m, 4), axis=0, return_inverse=True)
    count = np.bincount(number.ravel())
    found = _before_and_after(findings)
    value = [np.sqrt(np.bincount(number.ravel(), _rms(r)[touched] ** 2) / count) for _, r in found]
    limits = (0.0, max(1.2, max(float(v.max()) for v in value)))
    figure, axes = panels(len(found), width=4.4, height=3.9)
    for axis, (title, _), one in zip(axes, found, value, strict=True):
        squares = draw_taxels(axis, unique_m, one, limits, ERROR_MAP, "{:.2f}")
        _sheet(axis, findings, title)
    figure.colorbar(squares, ax=axes, shrink=0.85, label="misfit over noise")
    return figure


def _before_and_after(findings: Findings) -> list[tuple[str, Array]]:
    pairs = (("before", findings.residual_before), ("after", findings.residual_after))
    return [(title, residual) for title, residual in pairs if residual is not None]


def _sheet(axis: Axes, findings: Findings, title: str) -> None:
    """Outline and electrodes of the sheet, and the axes' names."""
    assert findings.evidence is not None
    sensor = findings.evidence.sensor
    axis.plot(*1e3 * np.vstack([sensor.outline_m, sensor.outline_m[:1]]).T, color=INK, lw=0.7)
    x_mm, y_mm = 1e3 * sensor.electrode_middle_m.T
    axis.scatter(x_mm, y_mm, s=10, marker="s", facecolors="none", edgecolors=INK, linewidths=0.7)
    axis.autoscale_view()
    (left, low), (right, high) = 1e3 * sensor.extent_m
    axis.set(xlim=(left - 2, right + 2), ylim=(low - 2, high + 2))
    axis.set(title=title, xlabel="x / mm", ylabel="y / mm", aspect="equal")


@styled
def _projected(findings: Findings, touched: NDArray[np.bool_]) -> Figure:
    assert findings.evidence is not None
    assert findings.selection is not None
    assert findings.residual_before is not None
    linear = findings.selection.problem.linear
    shown = [(rows, title) for rows, title in ((~touched, "at rest"), (touched, "under presses")) if rows.any()]
    figure, axes = panels(len(shown), width=4.9, height=3.9)
    for axis, (rows, title) in zip(axes, shown, strict=True):
        node_m, change = _backprojected(linear, findings.residual_before[rows], findings.evidence.noise_v)
        shape = tuple(len(a) for a in reversed(linear.sheet.hats.axes))
        top = max(100 * float(np.abs(change).max()), 1e-3)
        x, y = (1e3 * node_m[:, k].reshape(shape) for k in range(2))
        image = axis.pcolormesh(
            x, y, 100 * change.reshape(shape), vmin=-top, vmax=top, cmap="RdBu_r", shading="gouraud"
        )
        _sheet(axis, findings, title)
        figure.colorbar(image, ax=axis, shrink=0.85, label="change of conductance / %")
    return figure


def _backprojected(linear: LinearSkin, residual: Array, noise_v: float) -> tuple[Array, Array]:
    """Nodes (H,2) in metre, relative change of conductance (H,) most likely behind the mean residual of frames (n,P).

    ``residual`` in units of the noise. One linear step about the resting sheet with white noise and a white prior:
    Gauss-Newton imaging (Adler and Guardo, IEEE Trans. Med. Imaging 15 (1996) 170).
    """
    derivative = linear.sheet.derivatives[0][:, 0].astype(float) / noise_v
    mean, frames = residual.mean(axis=0), len(residual)
    hessian = frames * derivative.T @ derivative + np.eye(derivative.shape[1]) / PRIOR**2
    return linear.sheet.hats.node_m, np.asarray(np.linalg.solve(hessian, frames * derivative.T @ mean))


def _mapped(findings: Findings) -> list[tuple[str, FieldMap]]:
    """Name and field of every claim whose field differs from place to place."""
    claims = findings.diagnosis.claims
    return [(c.effect.name, c.field_map) for c in claims if c.field_map is not None and np.ptp(c.field_map.value) > 0]


@styled
def _fields(findings: Findings) -> Figure:
    found = _mapped(findings)
    figure, axes = panels(len(found), width=4.9, height=3.9)
    for axis, (name, field) in zip(axes, found, strict=True):
        (x_m, column), (y_m, row) = (np.unique(field.point_m[:, k], return_inverse=True) for k in range(2))
        percent = np.full((len(y_m), len(x_m)), np.nan)
        percent[row, column] = 100 * np.expm1(field.value)
        if field.determined is not None:
            percent[row[~field.determined], column[~field.determined]] = np.nan
        taxels = field.taxels
        known = np.zeros(0) if taxels is None or taxels.determined is None else taxels.value[taxels.determined]
        most = max(
            float(np.nanmax(np.abs(percent), initial=0.0)), float(np.abs(100 * np.expm1(known)).max(initial=0.0))
        )
        top = max(most, 1e-3)
        image = axis.pcolormesh(1e3 * x_m, 1e3 * y_m, percent, vmin=-top, vmax=top, cmap="RdBu_r", shading="nearest")
        _taxels(axis, taxels, top)
        _sheet(axis, findings, words_of(name))
        figure.colorbar(image, ax=axis, shrink=0.85, label="difference / %")
    return figure


def _taxels(axis: Axes, field: FieldMap | None, top: float) -> None:
    """Sensing points in the map's colours, up to ``top`` percent; crosses where nothing has told of them."""
    if field is None or field.determined is None:
        return
    known, (x_mm, y_mm) = field.determined, 1e3 * field.point_m.T
    percent = 100 * np.expm1(field.value[known])
    edge: dict[str, Any] = {"edgecolors": "0.3", "linewidths": 0.6, "s": 40}
    axis.scatter(x_mm[known], y_mm[known], c=percent, vmin=-top, vmax=top, cmap="RdBu_r", **edge)
    if not known.all():
        axis.scatter(x_mm[~known], y_mm[~known], c="0.6", marker="x", s=14, linewidths=0.8, label="not known")
        axis.legend(loc="upper right", bbox_to_anchor=(1.0, 1.09), frameon=False, fontsize="small")


def _phases_below(figure: Figure, axes: Sequence[Axes]) -> None:
    """One legend for all panels, where it hides no point."""
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(PHASES))


@styled
def _forces(findings: Findings) -> Figure:
    assert findings.evidence is not None
    assert findings.held is not None
    history = findings.evidence.history[findings.held]
    force_n = np.nan_to_num(history.force_n).sum(axis=1)
    found = _before_and_after(findings)
    figure, axes = panels(len(found), width=4.4)
    for axis, (title, residual) in zip(axes, found, strict=True):
        for phase, mark, name, colour in PHASES:
            mine = history.phase == phase
            if mine.any():
                axis.plot(force_n[mine], _rms(residual)[mine], mark, ms=4, alpha=0.6, color=colour, label=name)
        axis.axhline(1.0, color=INK, lw=0.8)
        axis.set_ylim(bottom=0.0)
        axis.set(title=title, xlabel="force / N", ylabel="misfit over noise")
    _phases_below(figure, axes)
    return figure


def _by_electrode(tests: tuple[AxisTest, ...]) -> AxisTest | None:
    return next((test for test in tests if test.axis == "electrode" and test.ratio), None)


@styled
def _electrodes(findings: Findings) -> Figure:
    figure, (axis,) = panels(width=6.2)
    for tests, name, colour in ((findings.tests_before, "before", ORANGE), (findings.tests_after, "after", BLUE)):
        if test := _by_electrode(tests):
            axis.plot(range(len(test.ratio)), test.ratio, "o-", ms=4, color=colour, label=name)
    axis.axhline(1.0, color=INK, lw=0.8)
    axis.set_ylim(bottom=0.0)
    axis.set(xlabel="electrode", ylabel="misfit over noise")
    axis.legend()
    return figure


@styled
def _force_depth(findings: Findings) -> Figure:
    assert findings.evidence is not None
    assert findings.baseline is not None
    history, baseline = findings.evidence.history, findings.baseline
    fits = (("linear pad", baseline.force_linear), ("with the effects named", baseline.force_best))
    found = [(title, fit) for title, fit in fits if fit is not None]
    figure, axes = panels(len(found), width=4.4)
    for axis, (title, fit) in zip(axes, found, strict=True):
        for phase, mark, name, colour in PHASES:
            mine = history.phase == phase
            if mine.any():
                off_n = baseline.force_noise.rms_n * fit.residual[mine, 0]
                axis.plot(1e3 * history.depth_m[mine, 0], off_n, mark, ms=3, alpha=0.5, color=colour, label=name)
        axis.axhline(0.0, color=INK, lw=0.8)
        axis.set(title=title, xlabel="commanded depth / mm", ylabel="measured minus model / N")
    _phases_below(figure, axes)
    return figure


@styled
def _specimen(findings: Findings) -> Figure:
    assert findings.baseline is not None
    signal = findings.baseline.specimen
    rising = np.gradient(signal.stress_pa) > 0
    figure, (axis,) = panels(width=6.2)
    for mine, mark, name, colour in ((rising, "^", "loading", BLUE), (~rising, "v", "unloading", ORANGE)):
        axis.plot(
            1e-3 * signal.stress_pa[mine], 1e-3 * signal.resistance_ohm_sq[mine], mark, ms=3, color=colour, label=name
        )
    axis.set(xlabel="stress / kPa", ylabel="sheet resistance / kΩ per square")
    axis.legend()
    return figure
