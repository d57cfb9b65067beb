"""A sweep's table on its MLflow run: written anew each time, whatever became of the one before."""

from __future__ import annotations

import io
import json
import math
import shutil
from pathlib import Path

import mlflow
import pytest
from mlflow.exceptions import MlflowException
from rich.console import Console

from ertskin.tracking.run import Run, fetch
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store, store_uri
from ertskin.tracking.sweep import RESULTS, SweepCallback
from ertskin.tracking.sweep_summary import JobResult, print_rows, rows_of, show_sweep

HIT = "validation_hit_rate_one"


@pytest.fixture
def settings(workplace: Path) -> TrackingSettings:
    return TrackingSettings(workplace / "runs/mlflow.db", workplace / "runs/artifacts", "test")


def sweep_run(settings: TrackingSettings) -> Run:
    return Run.begin(settings, "sweep", "sweep over grid, seed", reopen=True)


def results(*hits: float) -> list[JobResult]:
    return [JobResult({"grid": f"{n}x{n}", "seed": 0}, {HIT: hit}) for n, hit in enumerate(hits, 2)]


def kept(settings: TrackingSettings, run: Run) -> dict[str, list]:
    return json.loads(fetch(settings, run.run_id, "sweep.json").read_text())


def test_a_sweep_run_again_has_its_rows_once(settings: TrackingSettings) -> None:
    for hits in ((0.5,), (0.5, 0.75)):
        with sweep_run(settings) as run:
            show_sweep(run, results(*hits))
    assert kept(settings, run) == {
        "columns": ["grid", "jobs", "hit_rate_one"],
        "data": [["2x2", 1, 0.5], ["3x3", 1, 0.75]],
    }


def test_mlflow_shows_it_as_a_table(settings: TrackingSettings) -> None:
    with sweep_run(settings) as run:
        show_sweep(run, results(0.5, math.nan))
    client = open_store(settings.database)
    experiment = client.get_run(run.run_id).info.experiment_id
    # It asks MLflow's global store, whatever the client's own is.
    before = mlflow.get_tracking_uri()
    mlflow.set_tracking_uri(store_uri(settings.database))
    try:
        table = client.load_table(experiment, "sweep.json", [run.run_id])
    finally:
        mlflow.set_tracking_uri(before)
    assert table["hit_rate_one"].isna().tolist() == [False, True]


def test_a_table_whose_files_are_gone_is_written_anew(settings: TrackingSettings) -> None:
    with sweep_run(settings) as run:
        show_sweep(run, results(0.5))
    shutil.rmtree(settings.artifacts)
    with sweep_run(settings) as run:
        show_sweep(run, results(0.25))
    assert kept(settings, run)["data"] == [["2x2", 1, 0.25]]


def test_a_table_that_cannot_be_kept_costs_the_sweep_nothing(
    settings: TrackingSettings, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: object) -> None:
        raise MlflowException("no space\nleft")

    callback = SweepCallback()
    callback.run, callback.folder = sweep_run(settings), settings.database.parent
    run_id = callback.run.run_id
    (callback.folder / RESULTS).mkdir()
    (callback.folder / RESULTS / "job.json").write_text(json.dumps({"varied": {"grid": "2x2"}, "metrics": {HIT: 1.0}}))
    monkeypatch.setattr(Run, "columns", fails)
    callback.on_multirun_end(None)
    shown = capsys.readouterr()
    assert "2x2" in shown.out
    assert shown.err == "ertskin: the sweep's table could not be kept: no space left\n"
    assert open_store(settings.database).get_run(run_id).info.status == "FINISHED"


def test_every_number_is_whole_in_eighty_columns_however_long_the_effects() -> None:
    metrics = ("hit_rate_one", "force_rmse_one_n", "force_correlation_one", "exact_rate_two", "force_error_two_n")
    effects = "sheet_inhomogeneity_of_the_first_skin", "none"
    jobs = [
        JobResult({"model": "reciprocal", "effects": name, "seed": seed}, {f"validation_{m}": 0.25 for m in metrics})
        for name in effects
        for seed in (0, 1)
    ]
    stream = io.StringIO()
    print_rows(Console(file=stream, width=80), rows_of(jobs))
    text = stream.getvalue()
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    for shown in ("25.0 ±0.0", "0.25 ±0.00", "0.250 ±0.000"):
        assert text.count(shown) >= len(effects)
    assert text.count("RMSE 1") == 1
