"""What the physics that was found changed for the networks: every metric without it and with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.evaluation.results import MethodResult, metric_names
from ertskin.report.figures.before_and_after import LEAST, before_and_after
from ertskin.report.page import Picture, Row, Section, Table
from ertskin.report.units import METRICS

WORDS = (
    "The same networks, trained on the simulator as it was and on the simulator with the effects named, and tested on "
    "the same recordings, which neither the diagnosis nor any training has seen."
)
CAPTION = "Each cell: without the effects named → with them; means over the seeds."
DRAWN = ("location_error_mm", "force_rmse_one_n", "force_error_two_n")
"""Errors on the taxels that are drawn."""
DRAWN_BY_NUMBER = ("location_error_mm_", "force_error_n_")
"""And those of contacts anywhere, by how many there are."""


def change(methods: Sequence[MethodResult], pairs: Sequence[tuple[str, str]]) -> Section | None:
    """The section for ``pairs`` of names (without, with); None where there is no pair."""
    by_name = {method.name: method for method in methods}
    found = [(by_name[a], by_name[b]) for a, b in pairs if a in by_name and b in by_name]
    if not found:
        return None
    table = Table(("metric", *(before.name for before, _ in found)), tuple(_rows(found)), CAPTION)
    errors = [name for name in metric_names(methods) if name in DRAWN or name.startswith(DRAWN_BY_NUMBER)]
    drawn = before_and_after(
        [before.name for before, _ in found],
        [METRICS[name].label for name in errors],
        np.array([[[_mean(side, name) for name in errors] for side in pair] for pair in found]),
    )
    caption = (
        "Errors without the effects named (hollow) and with them (filled); to the left is better. "
        f"Less than {LEAST:g} is drawn as {LEAST:g}."
    )
    return Section(
        "What that changed for the networks",
        (WORDS,),
        tables=(table,),
        pictures=(Picture.of(drawn, caption, wide=True),),
    )


def _rows(pairs: Sequence[tuple[MethodResult, MethodResult]]) -> list[Row]:
    rows = []
    for name in metric_names([method for pair in pairs for method in pair]):
        metric = METRICS[name]
        values = [tuple(metric.text(_mean(side, name)) for side in pair) for pair in pairs]
        cells = [("–", "") if "–" in pair else (f"{pair[0]} → {pair[1]}", "") for pair in values]
        rows.append(Row(((metric.label, ""), *cells), "network"))
    return rows


def _mean(method: MethodResult, name: str) -> float:
    values = method.values(name)
    return float(values.mean()) if len(values) else float("nan")
