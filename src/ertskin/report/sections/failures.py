"""Where it fails: by force, by place, and the single frames that went wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.evaluation.outcome import Outcome
from ertskin.evaluation.results import MethodResult
from ertskin.report.figures.hit_rate_by_force import hit_rate_by_force
from ertskin.report.figures.taxel_map import ROUNDING, taxel_map
from ertskin.report.page import Picture, Row, Section, Table

LISTED = 12


def failures(methods: Sequence[MethodResult], shown: MethodResult) -> Section:
    """Hit rate against force for all methods; errors by place and wrong frames for ``shown``'s first seed."""
    run = shown.runs[0]
    outcome = run.outcome
    if outcome is None:
        return Section("Where it fails", ("No single answers were kept to look at.",))
    one, pictures = outcome.with_contacts(1), []
    if len(one.map_n):
        answers = {method.name: method.runs[0].outcome for method in methods if method.runs}
        hits = {name: _hit(answer.with_contacts(1)) for name, answer in answers.items() if answer is not None}
        pictures.append(
            Picture.of(hit_rate_by_force(one.true_map_n.sum(axis=1), hits), "Light touches are lost first.")
        )
        force = taxel_map(one.taxel_m, run.scores["force_rmse_one_n"].per_taxel, "force RMSE, one point / N")
        pictures.append(Picture.of(force, "Where the force is worst."))
    away_mm = run.scores["location_error_mm"].per_taxel
    if (away_mm > ROUNDING).any():
        where = taxel_map(outcome.taxel_m, away_mm, "location error / mm")
        pictures.append(Picture.of(where, "Where the place is worst, over all test frames."))
    wrong = np.flatnonzero(~_hit(outcome))
    words = (
        f"{shown.name}, seed {run.seed}, declares a wrong set of taxels in {len(wrong)} of {len(outcome.map_n)} frames."
        + (f" The {LISTED} with the largest force in the wrong place:" if len(wrong) > LISTED else ""),
    )
    tables = (_listed(outcome, wrong),) if len(wrong) else ()
    return Section("Where it fails", words, tables=tables, pictures=tuple(pictures))


def _hit(outcome: Outcome) -> NDArray[np.bool_]:
    """(N,) frames whose declared taxels are exactly the touched ones."""
    return (outcome.present == outcome.touched).all(axis=1)


def _listed(outcome: Outcome, wrong: NDArray[np.intp]) -> Table:
    misplaced_n = np.abs(np.where(outcome.present != outcome.touched, outcome.map_n + outcome.true_map_n, 0.0))
    worst = wrong[np.argsort(-misplaced_n[wrong].sum(axis=1), kind="stable")][:LISTED]
    rows = tuple(
        Row(
            (
                (str(frame), ""),
                (_said(outcome.true_map_n[frame], outcome.touched[frame]), ""),
                (_said(outcome.map_n[frame], outcome.present[frame]), ""),
            )
        )
        for frame in worst
    )
    return Table(("test frame", "truly there", "declared"), rows, "Taxels by number, from 0, with the force on each.")


def _said(map_n: NDArray[np.float64], present: NDArray[np.bool_]) -> str:
    return ", ".join(f"{taxel}: {map_n[taxel]:.1f} N" for taxel in np.flatnonzero(present)) or "nothing"
