"""The report of one evaluation, read from top to bottom: recording, model, network, failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ertskin.calibration.result import Calibration
from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.hardware.measurement import Recording
from ertskin.report.page import Page, Section, write_page
from ertskin.report.sections.anywhere import anywhere
from ertskin.report.sections.change import change
from ertskin.report.sections.failures import failures
from ertskin.report.sections.fit import fit
from ertskin.report.sections.grids import grids
from ertskin.report.sections.lacking import lacking, named_in
from ertskin.report.sections.network import network
from ertskin.report.sections.opened import opened
from ertskin.report.sections.recorded import recorded
from ertskin.report.units import METRICS

ASIDE = ("missed", "invented", "coverage", "novel")
"""Metrics that stand in the tables alone."""


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """All a report is made of; what is missing is left out of it.

    ``methods`` in the order of the table; ``shown`` names the one whose answers are pictured, the first network where
    it is None. ``recordings`` by the part they play, such as "training" or "one-point test".
    ``calibration_figures``: the folder ``ertskin calibrate`` drew into. ``footer``: lines on
    how the numbers came about (files, seeds, versions). ``diagnosis``: the folder of the training recording's, and
    ``pairs`` of names of methods trained without and with what it found. ``hidden``: what was sealed with a virtual
    recording, as (effects with their parameters, commitment).
    """

    title: str
    methods: Sequence[MethodResult]
    shown: str | None = None
    recordings: Mapping[str, Recording] = field(default_factory=dict)
    calibration: Calibration | None = None
    calibration_figures: Path | None = None
    footer: Sequence[str] = ()
    diagnosis: Path | None = None
    pairs: Sequence[tuple[str, str]] = ()
    hidden: tuple[Mapping[str, Mapping[str, Any]], str] | None = None


def write_report(path: Path, inputs: ReportInputs) -> Path:
    """Write the page to ``path``; raises ``ValueError`` where ``shown`` names no method or there is none at all."""
    shown = _shown(inputs)
    sections: list[Section] = []
    if inputs.recordings:
        sections.append(recorded(dict(inputs.recordings)))
    if inputs.calibration is not None:
        sections.append(fit(inputs.calibration, inputs.calibration_figures))
    if inputs.diagnosis is not None:
        sections.append(lacking(inputs.diagnosis))
    if (changed := change(inputs.methods, inputs.pairs)) is not None:
        sections.append(changed)
    if (by_grid := grids(inputs.methods)) is not None:
        sections.append(by_grid)
    if any(not name[-1].isdigit() for name in metric_names(inputs.methods)):
        alike = [method for method in inputs.methods if method.grid == shown.grid]
        sections += [network(inputs.methods, shown), failures(alike, shown)]
    if (between := anywhere(inputs.methods, shown)) is not None:
        sections.append(between)
    if inputs.hidden is not None:
        named = None if inputs.diagnosis is None else named_in(inputs.diagnosis)
        sections.append(opened(inputs.hidden[0], named, inputs.hidden[1]))
    return write_page(
        path, Page(inputs.title, _summary(shown), _key_numbers(shown), tuple(sections), tuple(inputs.footer))
    )


def _shown(inputs: ReportInputs) -> MethodResult:
    if not inputs.methods:
        raise ValueError("a report needs at least one method's result")
    if inputs.shown is None:
        return next((method for method in inputs.methods if method.kind == "network"), inputs.methods[0])
    for method in inputs.methods:
        if method.name == inputs.shown:
            return method
    raise ValueError(f"no method is named {inputs.shown!r}: {[method.name for method in inputs.methods]}")


def _summary(shown: MethodResult) -> str:
    seeds = len(shown.runs)
    return (
        f"Numbers of {shown.name}, mean over {seeds} seed{'s' if seeds > 1 else ''}, on test recordings it never "
        "learned from; the paper's own numbers, from its own rig, stand beside."
    )


def _key_numbers(shown: MethodResult) -> tuple[tuple[str, str], ...]:
    numbers = []
    for name, metric in METRICS.items():
        if name.startswith(ASIDE):
            continue
        values = shown.values(name)
        if len(values) and np.isfinite(values).any():
            in_paper = f" (paper {metric.with_unit(PAPER[name][0])})" if name in PAPER else ""
            numbers.append((metric.with_unit(float(values.mean())), f"{metric.head}{in_paper}"))
    return tuple(numbers)
