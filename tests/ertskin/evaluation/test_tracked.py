"""An evaluation in MLflow: what was tested stands apart from validation, yardsticks below their evaluation."""

from pathlib import Path

import numpy as np

from ertskin.evaluation.metrics import Score
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.evaluation.tracked import track
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store

SETTINGS = TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "test")


def scored(seed: int, value: float, run_id: str | None = None) -> SeedResult:
    score = Score("force_rmse_one_n", value, np.full(4, value))
    return SeedResult(seed, {score.name: score}, None, run_id)


def runs() -> dict:
    client = open_store(SETTINGS.database)
    found = client.search_runs([client.get_experiment_by_name("test").experiment_id])
    return {run.info.run_name: run for run in found}


def test_metrics_are_prefixed_yardsticks_nested_and_test_recordings_logged(workplace):
    with Run.begin(SETTINGS, "job", "reciprocal seed 1") as trained:
        trained.metrics({"validation_force_rmse_one_n": 0.5})
    methods = [
        MethodResult("reciprocal", "network", (scored(1, 0.25, trained.run_id),)),
        MethodResult("ridge", "yardstick", (scored(0, 2.0), scored(1, 3.0))),
        MethodResult("oracle", "yardstick", (scored(0, 0.125),)),
    ]
    tests = [DatasetInfo("one.h5", 64 * "a", "test", Path("one.h5"))]
    for _ in range(2):
        track(SETTINGS, methods, [], {"files": "these"}, tests)
    found = runs()
    assert set(found) == {"reciprocal seed 1", "evaluation on one.h5", "ridge seed 0", "ridge seed 1", "oracle"}
    assert found["reciprocal seed 1"].data.metrics == {
        "validation_force_rmse_one_n": 0.5,
        "test_force_rmse_one_n": 0.25,
    }
    parent = found["evaluation on one.h5"].info.run_id
    for name, value in (("ridge seed 0", 2.0), ("ridge seed 1", 3.0), ("oracle", 0.125)):
        assert found[name].data.metrics == {"test_force_rmse_one_n": value}
        assert found[name].data.tags["mlflow.parentRunId"] == parent
        assert found[name].info.status == "FINISHED"
        (data,) = found[name].inputs.dataset_inputs
        assert (data.dataset.name, data.dataset.digest, data.tags[0].value) == ("one.h5", 32 * "a", "test")
