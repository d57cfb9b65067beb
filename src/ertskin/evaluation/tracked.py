"""An evaluation in MLflow: test metrics on every network's own run, a run per yardstick, the report beside them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ertskin.evaluation.outcome import Outcome
from ertskin.evaluation.predictions import as_plain
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.report.figures.style import MAGNITUDE_MAP
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.figures.two_point_panels import two_point_panels
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store
from ertskin.tracking.sweep import job_key

if TYPE_CHECKING:
    from mlflow import MlflowClient


def track(
    tracking: TrackingSettings, methods: Sequence[MethodResult], files: Iterable[Path], about: dict[str, Any]
) -> None:
    """Log everything; the same evaluation done again goes to the same runs."""
    client = open_store(tracking.database)
    for method in methods:
        for number, result in enumerate(method.runs):
            with _run_of(client, tracking, method, result, about) as run:
                run.metrics({name: score.value for name, score in result.scores.items() if np.isfinite(score.value)})
                run.table(as_plain(result.scores), "test.json")
                if number == 0 and result.outcome is not None:
                    _draw(run, result, result.outcome)
                run.flush()
    with Run.begin(tracking, job_key({"evaluation": about}), "evaluation", reopen=True) as run:
        run.tag("ertskin.role", "evaluation")
        run.table(about, "about.json")
        for path in files:
            run.artifact(path)


def _run_of(
    client: MlflowClient, tracking: TrackingSettings, method: MethodResult, result: SeedResult, about: dict[str, Any]
) -> AbstractContextManager[Run]:
    """The training's own run, left as it ended; for a method without one, a run of this evaluation."""
    from mlflow.exceptions import MlflowException

    if result.run_id is not None:
        try:
            client.get_run(result.run_id)
        except MlflowException:
            pass  # A model that was trained elsewhere: its run isn't in this database.
        else:
            return nullcontext(Run(client, result.run_id, tracking.flush_s))
    key = job_key({"method": method.name, "seed": result.seed, "evaluation": about})
    return Run.begin(tracking, key, f"{method.name}, seed {result.seed}", {"ertskin.role": method.kind}, reopen=True)


def _draw(run: Run, result: SeedResult, outcome: Outcome) -> None:
    if (hit := result.scores.get("hit_rate_one")) is not None:
        drawn = taxel_map(outcome.taxel_m, 100 * hit.per_taxel, "hit rate / %", (0.0, 100.0), MAGNITUDE_MAP, "{:.0f}")
        run.figure(drawn, "hit_rate_one.png")
    two = outcome.with_contacts(2)
    if len(two.map_n):
        run.figure(two_point_panels(outcome.taxel_m, two.true_map_n, two.believed_map_n), "two_points.png")
