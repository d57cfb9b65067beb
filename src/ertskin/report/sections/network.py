"""How well the network does: every method on the same frames, and the paper's Figs. 10 and 11 for one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.evaluation.outcome import Outcome
from ertskin.evaluation.results import PAPER, MethodResult, metric_names
from ertskin.report.figures.force_scatter import force_scatter
from ertskin.report.figures.method_comparison import method_comparison
from ertskin.report.figures.style import MAGNITUDE_MAP
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.figures.two_point_panels import two_point_panels
from ertskin.report.method_table import method_table
from ertskin.report.page import Picture, Section
from ertskin.report.units import METRICS

COMPARED = ("hit_rate_one", "force_rmse_one_n", "exact_rate_two", "force_error_two_n")


def network(methods: Sequence[MethodResult], shown: MethodResult) -> Section:
    """The table of all methods, their comparison, and the answers of ``shown``'s first seed."""
    words = (
        "All methods of a grid saw the same test frames, none of which they learned from. The yardsticks tell what a "
        "simple method makes of the same readings; the oracle knows the calibrated physics and searches all contacts; "
        "the bound is what no unbiased method can go below.",
        f"The pictures show {shown.name}, seed {shown.runs[0].seed}.",
    )
    return Section(
        "How well the network does",
        words,
        tables=(method_table(methods),),
        pictures=(*_bars(methods), *_answers(shown)),
    )


def _bars(methods: Sequence[MethodResult]) -> list[Picture]:
    pictures = []
    for name in (name for name in COMPARED if name in metric_names(methods)):
        having = [method for method in methods if np.isfinite(method.values(name)).any()]
        metric = METRICS[name]
        drawn = method_comparison(
            [method.name for method in having],
            [metric.factor * method.values(name) for method in having],
            metric.label,
            [method.kind == "network" for method in having],
            metric.factor * PAPER[name][0],
        )
        pictures.append(
            Picture.of(drawn, f"{metric.head[0].upper()}{metric.head[1:]}: networks in blue, one tick per seed.")
        )
    return pictures


def _answers(shown: MethodResult) -> list[Picture]:
    run = shown.runs[0]
    outcome = run.outcome
    if outcome is None:
        return []
    pictures = []
    one, two = outcome.with_contacts(1), outcome.with_contacts(2)
    if len(one.map_n):
        hit = taxel_map(
            outcome.taxel_m,
            100 * run.scores["hit_rate_one"].per_taxel,
            "hit rate / %",
            (0.0, 100.0),
            MAGNITUDE_MAP,
            "{:.0f}",
        )
        pictures += [
            Picture.of(hit, "One-point hit rate by place (Fig. 10a)."),
            Picture.of(_scatter(one), "Estimated against true force, one point (Fig. 10b)."),
        ]
    if len(two.map_n):
        drawn = two_point_panels(outcome.taxel_m, two.true_map_n, two.believed_map_n)
        pictures.append(Picture.of(drawn, "Two-point trials: true maps beside the estimates (Fig. 11).", wide=True))
    return pictures


def _scatter(one: Outcome):
    touched = one.touched
    return force_scatter(one.true_map_n[touched], one.believed_map_n[touched], ~one.present[touched])
