"""An evaluation in MLflow: test metrics on every network's own run, a run per yardstick, the report beside them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ertskin.evaluation.outcome import Outcome
from ertskin.evaluation.predictions import as_builtins
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.report.figures.style import MAGNITUDE_MAP
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.figures.two_point_panels import two_point_panels
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store
from ertskin.tracking.sweep import job_key

if TYPE_CHECKING:
    from mlflow import MlflowClient


def track(
    tracking: TrackingSettings,
    methods: Sequence[MethodResult],
    files: Iterable[Path],
    about: dict[str, Any],
    tests: Sequence[DatasetInfo] = (),
) -> None:
    """Log everything; the same evaluation done again goes to the same runs.

    ``tests``: the recordings tested on. Metrics bear ``test_`` before their names: a network's run has those of its
    validation too.
    """
    client = open_store(tracking.database)
    with Run.begin(tracking, job_key({"evaluation": about}), _name(tests), reopen=True) as evaluation:
        evaluation.tag("ertskin.role", "evaluation")
        evaluation.table(about, "about.json")
        for path in files:
            evaluation.artifact(path)
        for method in methods:
            for number, result in enumerate(method.runs):
                with _run_of(client, tracking, method, result, about, evaluation.run_id) as run:
                    _log(run, result, tests, result.outcome if number == 0 else None)


def _name(tests: Sequence[DatasetInfo]) -> str:
    return " ".join(["evaluation on", *(data.name for data in tests)]) if tests else "evaluation"


def _log(run: Run, result: SeedResult, tests: Sequence[DatasetInfo], drawn: Outcome | None) -> None:
    for data in tests:
        run.dataset(data)
    run.metrics({f"test_{name}": score.value for name, score in result.scores.items() if np.isfinite(score.value)})
    run.table(as_builtins(result.scores), "test/per_taxel.json")
    if drawn is not None:
        _draw(run, result, drawn)
    run.flush()


def _run_of(
    client: MlflowClient,
    tracking: TrackingSettings,
    method: MethodResult,
    result: SeedResult,
    about: dict[str, Any],
    parent: str,
) -> AbstractContextManager[Run]:
    """The training's own run, left as it ended; for a method without one, a run below ``parent``."""
    from mlflow.exceptions import MlflowException

    if result.run_id is not None:
        try:
            client.get_run(result.run_id)
        except MlflowException:
            pass  # A model that was trained elsewhere: its run isn't in this database.
        else:
            return nullcontext(Run(client, result.run_id, tracking.flush_s))
    key = job_key({"method": method.name, "seed": result.seed, "evaluation": about})
    name = f"{method.name} seed {result.seed}" if len(method.runs) > 1 else method.name
    return Run.begin(tracking, key, name, {"ertskin.role": method.kind}, parent, reopen=True)


def _draw(run: Run, result: SeedResult, outcome: Outcome) -> None:
    if (hit := result.scores.get("hit_rate_one")) is not None:
        drawn = taxel_map(outcome.taxel_m, 100 * hit.per_taxel, "hit rate / %", (0.0, 100.0), MAGNITUDE_MAP, "{:.0f}")
        run.figure(drawn, "test/hit_rate_one.png")
    two = outcome.with_contacts(2)
    if len(two.map_n):
        run.figure(two_point_panels(outcome.taxel_m, two.true_map_n, two.believed_map_n), "test/two_points.png")
