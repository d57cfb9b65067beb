"""report.html: what was found, with figures before and after, in one file that needs nothing else."""

from __future__ import annotations

import base64
import html
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.backprojection import backprojected
from ertskin.diagnosis.claims import Claim, Diagnosis, gathered
from ertskin.diagnosis.drawn import Drawing, DrawnFindings
from ertskin.diagnosis.findings import Findings
from ertskin.diagnosis.residuals import AxisTest
from ertskin.diagnosis.summary import in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}"
    "table{border-collapse:collapse;margin:1rem 0}"
    "td,th{padding:.25rem .7rem;border-bottom:1px solid #ccc;text-align:left}"
    "img{max-width:100%}.verdict{font-size:1.6rem;font-weight:600}figcaption{color:#555;font-size:.9rem}"
)
MEANING = {
    "no_mismatch": "The simulator explains the recording to within the noise: nothing is missing.",
    "explained": "The simulator lacks the physics named below; with it, the recording is explained.",
    "partly_explained": "The simulator lacks the physics named below, and something else that is not named.",
    "unexplained": "The simulator misses something, and none of the known effects accounts for it.",
    "cannot_tell": "The recording can't answer.",
}


def write_report(folder: Path, findings: Findings) -> Path:
    """``folder/report.html``, written aside and renamed."""
    path = folder / "report.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".report.html.{os.getpid()}")
    aside.write_text(page(findings), encoding="utf-8")
    os.replace(aside, path)
    return path


def page(findings: Findings) -> str:
    """The report as one page of HTML."""
    diagnosis = findings.diagnosis
    parts = [
        f"<h1>Diagnosis of {html.escape(diagnosis.recording)}</h1>",
        f'<p class="verdict">{diagnosis.verdict}</p><p>{MEANING[diagnosis.verdict]}</p>',
    ]
    if diagnosis.reason:
        parts.append(f"<p>{html.escape(diagnosis.reason)}</p>")
    parts += [_misfit(diagnosis), _claims(diagnosis.claims)]
    for title, caption, draw in _figures(findings):
        parts.append(f"<h2>{title}</h2><figure>{_image(draw())}<figcaption>{caption}</figcaption></figure>")
    parts += [_tests("Where the misfit sat before", findings.tests_before)]
    parts += [_tests("Where it sits after", findings.tests_after)]
    body = "\n".join(part for part in parts if part)
    title = html.escape(diagnosis.recording)
    head = f'<meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
    return f'<!doctype html><html lang="en">{head}{body}</html>\n'


def _misfit(diagnosis: Diagnosis) -> str:
    held = diagnosis.held_out
    if held.ratio_before is None:
        return ""
    rows = [
        ("held out", html.escape(held.split)),
        ("misfit over noise before", f"{held.ratio_before:.3f}"),
        ("misfit over noise after", f"{held.ratio_after:.3f}"),
    ]
    if held.noise_rms_v is not None:
        rows.append(("noise of a reading", f"{1e3 * held.noise_rms_v:.3g} mV"))
    if diagnosis.remainder_ratio is not None:
        rows.append(("misfit after, with a nameless model of what stays", f"{diagnosis.remainder_ratio:.3f}"))
    if diagnosis.presses_differ is not None:
        rows.append(("what is left", html.escape(in_words(diagnosis.presses_differ))))
    if held.force_before_n is not None and held.force_after_n is not None:
        rows.append(("force rmse before, after", f"{held.force_before_n:.3g} N, {held.force_after_n:.3g} N"))
    return "<table>" + "".join(f"<tr><td>{a}</td><td>{b}</td></tr>" for a, b in rows) + "</table>"


def _claims(claims: tuple[Claim, ...]) -> str:
    if not claims:
        return ""
    rows = []
    for claim, name in gathered(claims):
        values = "<br>".join(
            f"{key} = {e.value:.4g} {e.unit} ({e.low:.4g} to {e.high:.4g})" for key, e in claim.parameters.items()
        )
        rivals = ", ".join(f"{n} ({c:.2f})" for n, c in claim.alternatives) or "none"
        rows.append(
            f"<tr><td><b>{name}</b><br>{claim.effect.stage}</td><td>{claim.confidence:.2f}</td>"
            f"<td>{claim.ratio_alone:.3g}</td><td>{values}</td><td>{rivals}</td></tr>"
        )
    head = "<tr><th>effect</th><th>confidence</th><th>misfit it makes</th><th>parameters, 90 %</th><th>else</th></tr>"
    sources = "".join(
        f"<li>{c.effect.name}: {html.escape((type(c.effect).__doc__ or '').splitlines()[0].replace('``', ''))} "
        f"<i>{html.escape(c.effect.source)}</i></li>"
        for c, _ in gathered(claims)
    )
    return f"<h2>What is missing</h2><table>{head}{''.join(rows)}</table><ul>{sources}</ul>"


def _tests(title: str, tests: tuple[AxisTest, ...]) -> str:
    rows = []
    for test in tests:
        if not test.ratio:
            continue
        worst = int(np.argmax(test.ratio))
        rows.append(
            f"<tr><td>{test.axis}</td><td>{min(test.ratio):.3f} to {max(test.ratio):.3f}</td>"
            f"<td>{html.escape(test.label[worst])}</td><td>{test.p_value:.2g}</td></tr>"
        )
    head = "<tr><th>axis</th><th>misfit over noise</th><th>most at</th><th>p, corrected</th></tr>"
    return f"<h2>{title}</h2><table>{head}{''.join(rows)}</table>" if rows else ""


def _figures(findings: Findings) -> Iterator[Drawing]:
    if isinstance(findings, DrawnFindings):
        yield from findings.drawings
    if findings.evidence is None or findings.residual_before is None or findings.held is None:
        return
    yield (
        "Misfit over the sheet",
        "Rms residual of held-out presses in units of the noise, by place (the paper's Fig. 8a), before and after.",
        lambda: _places(findings),
    )
    if findings.selection is not None:
        yield (
            "Where the sheet would have to differ",
            "The mean misfit of held-out frames before, projected back on the resting sheet: the relative change of "
            "conductance that would explain it best, at rest and under presses. Dots: electrodes.",
            lambda: _projected(findings),
        )
    yield (
        "Misfit against force",
        "The same against the contact force (the paper's Fig. 8b), loading and unloading apart.",
        lambda: _forces(findings),
    )
    yield (
        "Misfit by electrode",
        "Rms residual of the readings at each electrode, before and after.",
        lambda: _electrodes(findings),
    )
    if findings.baseline is not None and findings.baseline.force_plain is not None:
        yield (
            "Force against depth",
            "Load cell against the force stage: residuals of a linear pad and of the pad with the effects named.",
            lambda: _force_depth(findings),
        )
    if findings.baseline is not None:
        yield ("The specimen", "Sheet resistance of the specimen against stress.", lambda: _specimen(findings))


def _canvas(columns: int, height: float = 3.6) -> tuple[Figure, list]:  # type: ignore[type-arg]
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * columns, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(1, columns, k + 1) for k in range(columns)]


def _image(figure: Figure) -> str:
    held = io.BytesIO()
    figure.savefig(held, format="png", dpi=110)
    return f'<img src="data:image/png;base64,{base64.b64encode(held.getvalue()).decode()}" alt="">'


def _rms(residual: Array) -> Array:
    return np.asarray(np.sqrt((residual**2).mean(axis=1)))


def _places(findings: Findings) -> Figure:
    figure, axes = _canvas(2)
    assert findings.evidence is not None
    assert findings.held is not None
    history = findings.evidence.history[findings.held]
    touched = history.touched.any(axis=1)
    pairs = [_rms(r) for r in (findings.residual_before, findings.residual_after) if r is not None]
    top = max(float(p[touched].max()) for p in pairs)
    for axis, rms, title in zip(axes, pairs, ("before", "after"), strict=False):
        place = history.contact_m[touched, 0]
        unique, number = np.unique(np.round(place, 4), axis=0, return_inverse=True)
        value = np.sqrt(np.bincount(number.ravel(), rms[touched] ** 2) / np.bincount(number.ravel()))
        dots = axis.scatter(*(1e3 * unique.T), c=value, s=320, marker="s", vmin=1.0, vmax=max(top, 1.2), cmap="viridis")
        for (x, y), v in zip(unique, value, strict=True):
            axis.annotate(f"{v:.2f}", (1e3 * x, 1e3 * y), ha="center", va="center", fontsize=7, color="white")
        axis.scatter(*(1e3 * findings.evidence.sensor.electrode_center_m.T), s=6, c="k")
        axis.set(title=title, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    figure.colorbar(dots, ax=axes, label="misfit over noise")
    return figure


def _projected(findings: Findings) -> Figure:
    figure, axes = _canvas(2)
    assert findings.evidence is not None
    assert findings.held is not None
    assert findings.selection is not None
    assert findings.residual_before is not None
    linear = findings.selection.problem.linear
    touched = findings.evidence.history[findings.held].touched.any(axis=1)
    for axis, rows, title in zip(axes, (~touched, touched), ("at rest", "under presses"), strict=True):
        axis.set(title=title, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        if not rows.any():
            continue
        node_m, change = backprojected(linear, findings.residual_before[rows], findings.evidence.noise_v)
        shape = tuple(len(a) for a in reversed(linear.sheet_hats.axes))
        top = max(100 * float(np.abs(change).max()), 1e-3)
        x, y = (1e3 * node_m[:, k].reshape(shape) for k in range(2))
        image = axis.pcolormesh(
            x, y, 100 * change.reshape(shape), vmin=-top, vmax=top, cmap="RdBu_r", shading="gouraud"
        )
        axis.scatter(*(1e3 * findings.evidence.sensor.electrode_center_m.T), s=6, c="k")
        figure.colorbar(image, ax=axis, label="change of conductance (%)")
    return figure


def _forces(findings: Findings) -> Figure:
    figure, axes = _canvas(2)
    assert findings.evidence is not None
    assert findings.held is not None
    history = findings.evidence.history[findings.held]
    force = np.nan_to_num(history.force_n).sum(axis=1)
    for axis, residual, title in zip(
        axes, (findings.residual_before, findings.residual_after), ("before", "after"), strict=True
    ):
        if residual is None:
            continue
        rms = _rms(residual)
        for phase, mark in ((1, "^"), (2, "o"), (3, "v")):
            mine = history.phase == phase
            axis.plot(force[mine], rms[mine], mark, ms=4, alpha=0.6, label=("", "loading", "hold", "unloading")[phase])
        axis.axhline(1.0, color="k", lw=0.8)
        axis.set(title=title, xlabel="force (N)", ylabel="misfit over noise")
        axis.legend()
    return figure


def _electrodes(findings: Findings) -> Figure:
    figure, (axis,) = _canvas(1)
    for tests, name in ((findings.tests_before, "before"), (findings.tests_after, "after")):
        for test in tests:
            if test.axis == "electrode" and test.ratio:
                axis.plot(range(len(test.ratio)), test.ratio, "o-", ms=4, label=name)
    axis.axhline(1.0, color="k", lw=0.8)
    axis.set(xlabel="electrode", ylabel="misfit over noise")
    axis.legend()
    return figure


def _force_depth(findings: Findings) -> Figure:
    figure, axes = _canvas(2)
    assert findings.evidence is not None
    assert findings.baseline is not None
    history, baseline = findings.evidence.history, findings.baseline
    for axis, fit, title in zip(
        axes, (baseline.force_plain, baseline.force_best), ("linear pad", "with effects"), strict=True
    ):
        if fit is None:
            continue
        for phase, mark in ((1, "^"), (2, "o"), (3, "v")):
            mine = history.phase == phase
            axis.plot(
                1e3 * history.depth_m[mine, 0],
                baseline.force_noise.rms_n * fit.residual[mine, 0],
                mark,
                ms=3,
                alpha=0.5,
            )
        axis.set(title=title, xlabel="commanded depth (mm)", ylabel="measured minus model (N)")
    return figure


def _specimen(findings: Findings) -> Figure:
    figure, (axis,) = _canvas(1)
    assert findings.baseline is not None
    signal = findings.baseline.specimen
    rising = np.gradient(signal.stress_pa) > 0
    axis.plot(1e-3 * signal.stress_pa[rising], 1e-3 * signal.resistance_ohm_sq[rising], "^", ms=3, label="loading")
    axis.plot(1e-3 * signal.stress_pa[~rising], 1e-3 * signal.resistance_ohm_sq[~rising], "v", ms=3, label="unloading")
    axis.set(xlabel="stress (kPa)", ylabel="sheet resistance (kohm per square)")
    axis.legend()
    return figure
