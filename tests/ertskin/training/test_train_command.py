"""``ertskin train`` as a whole: it learns, it is tracked, it goes on after a kill, it sweeps."""

import json
import os
import re
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
from hydra import compose, initialize_config_dir
from processor_time import command_s, light_imports_s
from resistor_sheet import material, mixed

from ertskin import cli
from ertskin.configuration import choices, config_dir
from ertskin.data.sources import calibration_path
from ertskin.data.split import split
from ertskin.evaluation.predictions import evaluate_predictions, tuned_threshold_n
from ertskin.evaluation.yardsticks import Ridge
from ertskin.models.reconstruction import Reconstruction
from ertskin.tracking.model import load_model
from ertskin.tracking.run import fetch
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store
from ertskin.training.request import requested
from ertskin.training.settings import trainer_settings

pytestmark = pytest.mark.long

TRACKING = TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "ertskin")
PYTHON_PATH = os.pathsep.join([str(TEST_CONF.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
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
    assert re.search(
        r"trained: hit rate, one point [\d.]+ %; force RMSE, one point [\d.]+ N; ", capsys.readouterr().out
    )
    (run,) = runs()
    assert run.info.status == "FINISHED"
    assert run.data.params["data_checksum"] == "resistor-sheet-1500"
    assert run.data.params["model.name"] == "reciprocal"
    assert {"validation_hit_rate_one", "validation_exact_rate_two"} <= set(run.data.metrics)
    drawn = {file.path for file in open_store(TRACKING.database).list_artifacts(run.info.run_id, "validation")}
    assert {"validation/force_one.png", "validation/hit_rate_one.png", "validation/per_taxel.json"} <= drawn

    assert run.info.run_name == "reciprocal seed 0"
    assert {key: run.data.params[key] for key in ("model", "noise", "data", "effects")} == {
        "model": "reciprocal",
        "noise": "measured",
        "data": "resistor_sheet",
        "effects": "none",
    }
    assert not [name for name in run.data.params if "_target_" in name or "_partial_" in name]
    (data,) = run.inputs.dataset_inputs
    assert (data.dataset.name, data.dataset.digest) == ("trials resistor_sheet recording", "resistor-sheet-1500")

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
    history = open_store(TRACKING.database).get_metric_history(run.info.run_id, "network_training_loss")
    assert [point.step for point in history] == list(range(25))


LOAD_AND_PREDICT = """
import mlflow, numpy as np, sys
mlflow.set_tracking_uri("sqlite:///runs/mlflow.db")
model = mlflow.pyfunc.load_model(f"runs:/{sys.argv[1]}/model")
print(model.metadata.signature.inputs)
np.savez("answer.npz", **model.predict(np.load("change.npy")))
"""


@pytest.mark.parametrize("model", ["places", "paper"])
def test_mlflow_itself_loads_the_model_and_predicts(workplace, model):
    assert train(f"model={model}", "trainer.max_epochs=2", "data.source.count=150") == 0
    (run,) = runs()
    ours = load_model(TRACKING, run.info.run_id)
    change_v = mixed(7, seed=3).readings_v(ours.protocol).reshape(-1, *ours.protocol.shape)
    np.save("change.npy", change_v)
    command = [sys.executable, "-c", LOAD_AND_PREDICT, run.info.run_id]
    theirs = subprocess.run(command, capture_output=True, text=True, check=True)
    assert theirs.stdout == "[Tensor('float32', (-1, 28, 8))]\n"
    expected, answer = ours.estimate(change_v), np.load("answer.npz")
    # Another process may add up in another order.
    np.testing.assert_allclose(answer["force_map_n"], expected.force_map_n, atol=1e-5)
    np.testing.assert_array_equal(answer["present"], expected.present)
    assert ("contact_m" in answer) == (model == "places")
    (output,) = run.outputs.model_outputs
    logged = open_store(TRACKING.database).get_logged_model(output.model_id)
    files = {path.name for path in Path(logged.artifact_location.removeprefix("file://")).rglob("*")}
    assert {"MLmodel", "model.pt", "input_example.json"} <= files
    assert not [name for name in files if name.endswith(".pkl")]


QUICK = ["model=reciprocal", "model.network.width=16", "trainer.max_epochs=2", "data.source.count=150"]
ASK_AGAIN = """
import sys, time
from ertskin import cli
from ertskin.configuration import choices, config_dir
status = cli.main(sys.argv[1:])
heavy = {"torch", "lightning", "mlflow", "scipy", "matplotlib"} & set(sys.modules)
print(f"{sorted(heavy)} loaded, {time.process_time():.2f} s of CPU", file=sys.stderr)
sys.exit(status)
"""


def test_a_finished_job_is_found_without_loading_what_it_took_to_train(workplace):
    assert train(*QUICK) == 0
    job = only_job()
    command = [sys.executable, "-c", ASK_AGAIN, "train", *COMMON, *QUICK]
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "reciprocal seed 0: done before" in again.stdout
    assert again.stderr.startswith("[] loaded")
    assert command_s("train", *COMMON, *QUICK) < 5 * light_imports_s()
    (job / "model.pt").write_bytes(b"damaged")
    assert train(*QUICK) == 0
    assert Reconstruction.load(only_job() / "model.pt").about["run_id"] == runs()[0].info.run_id


@pytest.mark.parametrize(
    "setting",
    ["trainer.checkpoint_s=1.5", "trainer.batches_per_chunk=8", "cluster.workers=3", "tracking.flush_s=1"],
)
def test_what_does_not_change_the_outcome_makes_no_other_job(workplace, capsys, setting):
    assert train(*QUICK) == 0
    assert train(*QUICK, setting) == 0
    assert "done before" in capsys.readouterr().out
    assert len(runs()) == 1


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("seed=abc", "seed must be a whole number, not 'abc'"),
        ("seed=-1", "seed must be at least 0, not -1"),
        ("trainer.max_epochs=two", "trainer.max_epochs must be a whole number, not 'two'"),
        ("trainer.learning_rate=-1", "trainer.learning_rate must be above 0, not -1.0"),
        ("trainer.learning_rate=nan", "trainer.learning_rate must be above 0, not nan"),
        ("trainer.accelerator=tpu", "trainer.accelerator must be one of auto, cpu, gpu, not tpu"),
        ("+trainer.epochs=3", "no setting 'trainer.epochs'"),
        ("tracking.flush_s=soon", "tracking.flush_s must be a number, not 'soon'"),
        ("model.network.width=wide", "model.network.width must be a whole number, not 'wide'"),
        ("recording=nowhere.h5", "nowhere.h5: no such file"),
    ],
)
def test_a_wrong_value_is_refused_in_one_line(workplace, capsys, setting, words):
    assert train(*QUICK, setting) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"ertskin: {words}")
    assert err.count("\n") == 1
    assert not Path("runs/train").exists()


def test_a_wrong_value_is_refused_before_anything_heavy_is_loaded(workplace):
    command = [sys.executable, "-c", ASK_AGAIN, "train", *COMMON, *QUICK, "seed=abc"]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    line, loaded = refused.stderr.splitlines()
    assert line == "ertskin: seed must be a whole number, not 'abc'"
    assert loaded.startswith("[] loaded")


@pytest.mark.parametrize(
    ("swept", "words"),
    [
        ("seed=0,abc", "seed must be a whole number, not 'abc'"),
        ("trainer.learning_rate=1e-3,-1", "trainer.learning_rate must be above 0, not -1.0"),
        ("model=reciprocal,parper", "no model is named 'parper': choose from "),
        ("model.network.width=64,wide", "model.network.width must be a whole number, not 'wide'"),
    ],
)
def test_a_wrong_value_in_a_sweep_is_refused_before_its_first_job(workplace, capsys, swept, words):
    assert train("-m", *QUICK, swept) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith(f"ertskin: {words}")
    assert shown.err.count("\n") == 1
    assert not Path("runs/train").exists()
    assert open_store(TRACKING.database).get_experiment_by_name("ertskin") is None


def test_a_gpu_that_is_not_there_is_refused(workplace, capsys):
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    assert train(*QUICK, "trainer.accelerator=gpu") == 2
    assert "ertskin: trainer.accelerator=gpu: " in capsys.readouterr().err


def test_another_recording_or_calibration_makes_another_job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("skin.h5").write_bytes(b"one")
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("train", ["recording=skin.h5"])
    assert requested(config) is None
    folder = calibration_path(config).parent
    folder.mkdir(parents=True)
    calibration_path(config).write_text("first")
    first = requested(config).key
    assert requested(config).key == first
    calibration_path(config).write_text("second")
    second = requested(config).key
    Path("skin.h5").write_bytes(b"two")
    calibration_path(config).parent.mkdir()
    calibration_path(config).write_text("second")
    third = requested(config).key
    assert len({first, second, third}) == 3
    config.calibration.file = str(calibration_path(config))
    config.recording = str(Path("skin.h5").rename("moved.h5"))
    assert requested(config).key == third


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


def test_killed_in_either_stage_and_started_again_it_ends_with_the_same_weights(workplace, undisturbed, capsys):
    command = [sys.executable, "-m", "ertskin.cli", "train", *COMMON, *PAPER]
    environment = {**os.environ, "PYTHONPATH": PYTHON_PATH}
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
    assert "network: going on from epoch" in capsys.readouterr().err
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


SWEEP = ["-m", *QUICK]


def children() -> list:
    """Runs of the sweep's jobs."""
    parent = json.loads(next(Path("runs/sweep").glob("*/parent.json")).read_text())["run_id"]
    return [run for run in runs() if run.data.tags.get("mlflow.parentRunId") == parent]


def test_a_sweep_has_a_parent_skips_what_is_done_and_shows_failures_at_once(workplace, capfd):
    asked = [*SWEEP, "seed=0,1", "trainer.learning_rate=0.001,1e30"]
    assert train(*asked) == 1
    assert sorted(run.info.status for run in children()) == ["FAILED", "FAILED", "FINISHED", "FINISHED"]
    names = {run.info.run_name for run in children() if run.info.status == "FINISHED"}
    assert names == {f"reciprocal learning_rate 0.001 seed {seed}" for seed in (0, 1)}
    shown = capfd.readouterr()
    assert shown.err.count("ertskin: FAILED") == 2
    assert "not every job of the sweep succeeded" in shown.err
    assert train(*asked) == 1
    shown = capfd.readouterr()
    assert shown.out.count("done before") == 2
    assert shown.err.count("ertskin: FAILED") == 2
    assert len(runs()) == 5


def test_a_sweep_ends_with_its_table_and_keeps_table_and_figure(workplace, capfd):
    assert train(*QUICK, "-m", "grid=2x2,10x10", "seed=0,1") == 0
    shown = capfd.readouterr().out.splitlines()
    head = next(number for number, line in enumerate(shown) if line.strip().startswith("grid"))
    rows = [line.split()[0] for line in shown[head + 2 :] if line.strip()]
    assert rows[:2] == ["2x2", "10x10"]
    (parent,) = [run for run in runs() if run.info.run_name == "sweep over grid, seed"]
    table = json.loads(fetch(TRACKING, parent.info.run_id, "sweep.json").read_text())
    of = {name: [row[number] for row in table["data"]] for number, name in enumerate(table["columns"])}
    assert of["grid"] == ["2x2", "10x10"]
    assert of["jobs"] == [2, 2]
    mean = np.mean([run.data.metrics["validation_hit_rate_one"] for run in children()])
    np.testing.assert_allclose(np.mean(of["hit_rate_one"]), mean)
    assert fetch(TRACKING, parent.info.run_id, "sweep.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", choices("experiment"))
def test_an_experiments_settings_fit_together(name):
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("train", [f"experiment={name}", "recording=skin.h5"], return_hydra_config=True)
    trainer_settings(config.trainer, config.seed)
    assert (config.hydra.mode is not None) == (name == "sweep")


def test_an_experiment_may_be_a_sweep(workplace, capfd):
    Path("conf/experiment").mkdir(parents=True)
    asked = "# @package _global_\nhydra: {mode: MULTIRUN, sweeper: {params: {seed: '0,1'}}}\n"
    Path("conf/experiment/two.yaml").write_text(asked)
    settings = f"hydra.searchpath=[file://{TEST_CONF},file://{Path('conf').resolve()}]"
    assert cli.main(["train", settings, *COMMON[2:], *QUICK, "experiment=two"]) == 0
    assert sorted(run.info.run_name for run in children()) == ["reciprocal seed 0", "reciprocal seed 1"]


@pytest.mark.parametrize(
    "launcher", [("joblib", "hydra.launcher.n_jobs=2"), ("submitit_local", "hydra.launcher.timeout_min=5")]
)
def test_a_sweep_runs_through_other_launchers(workplace, monkeypatch, capfd, launcher):
    monkeypatch.setenv("PYTHONPATH", PYTHON_PATH)
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
