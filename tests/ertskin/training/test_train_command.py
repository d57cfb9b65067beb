"""``ertskin train`` as a whole: it learns, it is tracked, it goes on after a kill, it sweeps."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import TEST_CONF
from resistor_sheet import material, mixed

from ertskin import cli
from ertskin.data.split import split
from ertskin.evaluation.predictions import evaluate_predictions, tuned_threshold_n
from ertskin.evaluation.yardsticks import Ridge
from ertskin.models.reconstruction import Reconstruction
from ertskin.tracking.model import load_model
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store

TRACKING = TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "ertskin")
COMMON = ["--config-dir", str(TEST_CONF), "data=resistor_sheet", "recording=null", "trainer.accelerator=cpu"]


def train(*overrides: str) -> int:
    return cli.main(["train", *COMMON, *overrides])


def runs() -> list:
    client = open_store(TRACKING.database)
    return client.search_runs([client.get_experiment_by_name("ertskin").experiment_id])


def only_job() -> Path:
    (folder,) = Path("runs/train").iterdir()
    return folder


def test_a_small_training_learns_and_its_model_comes_back_from_mlflow(workplace, capsys):
    assert train("model=reciprocal", "model.network.width=64", "trainer.max_epochs=25") == 0
    assert "trained" in capsys.readouterr().out
    (run,) = runs()
    assert run.info.status == "FINISHED"
    assert run.data.params["data_checksum"] == "resistor-sheet-1500"
    assert run.data.params["model.name"] == "reciprocal"
    assert {"validation_hit_rate_one", "validation_exact_rate_two"} <= set(run.data.metrics)
    drawn = {file.path for file in open_store(TRACKING.database).list_artifacts(run.info.run_id, "validation")}
    assert {"validation/force_one.png", "validation/hit_rate_one.png", "validation/per_taxel.json"} <= drawn

    # Judged on fresh trials, beside ridge regression on the very same material.
    made = material(None, 1500)
    fresh = mixed(600, seed=7)
    change_v = fresh.coordinates_v(made.protocol) + made.noise.coordinates(np.random.default_rng(1), len(fresh))
    estimate = load_model(TRACKING, run.info.run_id).estimate_coordinates(change_v)
    ours = evaluate_predictions(fresh.force_map_n, estimate.force_map_n, made.taxel_m, present=estimate.present)
    rows, _ = split(len(made.trials), 0)
    seen = made.trials[rows]
    seen_v = seen.coordinates_v(made.protocol) + made.noise.coordinates(np.random.default_rng(2), len(seen))
    ridge = Ridge().fit(seen_v, seen.force_map_n)
    threshold_n = tuned_threshold_n(seen.force_map_n, ridge.predict(seen_v))
    theirs = evaluate_predictions(fresh.force_map_n, ridge.predict(change_v), made.taxel_m, threshold_n=threshold_n)
    assert ours["hit_rate_one"].value > 0.9
    assert ours["exact_rate_two"].value > theirs["exact_rate_two"].value + 0.03
    assert ours["force_error_two_n"].value < 0.7 * theirs["force_error_two_n"].value

    assert train("model=reciprocal", "model.network.width=64", "trainer.max_epochs=25") == 0
    assert "done before" in capsys.readouterr().out
    assert len(runs()) == 1


PAPER = ["model=paper", "model.denoiser.hidden=16", "trainer.max_epochs=12", "data.source.count=900"]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, fresh_database) -> dict:
    """Content of the paper's model trained without a kill."""
    folder, before = tmp_path_factory.mktemp("undisturbed"), Path.cwd()
    shutil.copytree(fresh_database, folder / "runs")
    os.chdir(folder)
    try:
        assert train(*PAPER) == 0
        return torch.load(only_job() / "model.pt", weights_only=True)
    finally:
        os.chdir(before)


def test_killed_in_either_stage_and_started_again_it_ends_with_the_same_weights(workplace, undisturbed):
    command = [sys.executable, "-m", "ertskin.cli", "train", *COMMON, *PAPER]
    environment = {**os.environ, "PYTHONPATH": str(TEST_CONF.parent)}
    for stage, epochs in (("denoiser", 2), ("network", 5)):
        process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
        try:
            _wait_for_epoch(process, stage, epochs)
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()
        (run,) = runs()
        assert run.info.status == "RUNNING"
    assert train(*PAPER) == 0
    (run,) = runs()
    assert run.info.status == "FINISHED"
    model = torch.load(only_job() / "model.pt", weights_only=True)
    for part in ("denoiser", "network"):
        assert model[part]["state"].keys() == undisturbed[part]["state"].keys()
        for name, value in undisturbed[part]["state"].items():
            assert torch.equal(model[part]["state"][name], value), (part, name)


def _wait_for_epoch(process: subprocess.Popen, stage: str, epochs: int) -> None:
    """Until ``last.ckpt`` of the stage has been written for that many epochs."""
    deadline, seen = time.monotonic() + 120, set()
    while len(seen) < epochs:
        assert process.poll() is None, "training ended before it could be killed"
        assert time.monotonic() < deadline
        seen |= {path.stat().st_mtime_ns for path in Path("runs/train").glob(f"*/{stage}/last.ckpt")}
        time.sleep(0.002)


def test_a_diverging_training_fails_in_one_line_and_its_run_is_marked(workplace, capsys):
    assert train("model=reciprocal", "trainer.learning_rate=1e30", "trainer.max_epochs=2") == 1
    err = capsys.readouterr().err
    assert err == "ertskin: the training loss is no longer finite in epoch 0\n"
    (run,) = runs()
    assert run.info.status == "FAILED"


SWEEP = ["-m", "model=reciprocal", "model.network.width=16", "trainer.max_epochs=2", "data.source.count=150"]


def children() -> list:
    """Runs of the sweep's jobs."""
    parent = json.loads(next(Path("runs/sweep").glob("*/parent.json")).read_text())["run_id"]
    return [run for run in runs() if run.data.tags.get("mlflow.parentRunId") == parent]


def test_a_sweep_has_a_parent_skips_what_is_done_and_shows_failures_at_once(workplace, capfd):
    asked = [*SWEEP, "seed=0,1", "trainer.learning_rate=0.001,1e30"]
    assert train(*asked) == 1
    assert sorted(run.info.status for run in children()) == ["FAILED", "FAILED", "FINISHED", "FINISHED"]
    shown = capfd.readouterr()
    assert shown.err.count("ertskin: FAILED") == 2
    assert "not every job of the sweep succeeded" in shown.err
    assert train(*asked) == 1
    shown = capfd.readouterr()
    assert shown.out.count("done before") == 2
    assert shown.err.count("ertskin: FAILED") == 2
    assert len(runs()) == 5


@pytest.mark.parametrize(
    "launcher", [("joblib", "hydra.launcher.n_jobs=2"), ("submitit_local", "hydra.launcher.timeout_min=5")]
)
def test_a_sweep_runs_through_other_launchers(workplace, monkeypatch, capfd, launcher):
    monkeypatch.setenv("PYTHONPATH", str(TEST_CONF.parent))
    assert train(*SWEEP, f"hydra/launcher={launcher[0]}", launcher[1], "trainer.learning_rate=0.001,1e30") == 1
    assert sorted(run.info.status for run in children()) == ["FAILED", "FINISHED"]
    assert "not every job of the sweep succeeded" in capfd.readouterr().err


def test_a_model_file_that_would_execute_something_is_refused(workplace):
    from ertskin.errors import UserError

    class Evil:
        def __reduce__(self):
            return os.system, ("touch executed",)

    torch.save({"format": "ertskin-model", "network": Evil()}, "evil.pt")
    with pytest.raises(UserError, match="no model file"):
        Reconstruction.load(Path("evil.pt"))
    content = {"format": "ertskin-model", "format_version": 1, "denoiser": None, "about": {}}
    arrays = {"injection_current_a": torch.zeros(1, 2), "measurement": torch.zeros(1, 1, 2)}
    network = {"target": "os.system", "arguments": {"command": "touch executed"}, "state": {}}
    torch.save({**content, "protocol": arrays, "network": network}, "evil.pt")
    with pytest.raises(UserError, match=r"names the network 'os\.system'"):
        Reconstruction.load(Path("evil.pt"))
    assert not Path("executed").exists()
