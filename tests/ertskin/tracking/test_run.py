"""Runs end with the status they deserve, and are gone on with."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mlflow.exceptions import MlflowException

from ertskin.errors import JobFailed, UserError
from ertskin.interrupts import Terminated
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.run import Run, fetch, flattened
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import ensure_database, open_store


@pytest.fixture
def settings(workplace) -> TrackingSettings:
    return TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "test", flush_s=1000.0)


def info(settings, run_id):
    return open_store(settings.database).get_run(run_id)


@pytest.mark.parametrize(
    ("error", "status"),
    [(None, "FINISHED"), (JobFailed("diverged"), "FAILED"), (KeyboardInterrupt(), "KILLED"), (Terminated(), "KILLED")],
)
def test_how_a_run_is_left_decides_its_status(settings, error, status):
    run = Run.begin(settings, "key", "name")
    with contextlib.nullcontext() if error is None else pytest.raises(type(error)), run:
        if error is not None:
            raise error
    assert info(settings, run.run_id).info.status == status
    assert info(settings, run.run_id).data.tags.get("ertskin.error", "") == (
        "JobFailed: diverged" if status == "FAILED" else ""
    )


def test_a_run_that_was_cut_off_is_gone_on_with_and_a_finished_one_is_not(settings):
    with pytest.raises(JobFailed), Run.begin(settings, "key", "name") as first:
        raise JobFailed("once")
    assert info(settings, first.run_id).info.status == "FAILED"
    with Run.begin(settings, "key", "name") as second:
        pass
    assert second.run_id == first.run_id
    assert "ertskin.error" not in info(settings, second.run_id).data.tags
    assert info(settings, first.run_id).info.status == "FINISHED"
    with Run.begin(settings, "key", "name") as third:
        pass
    assert third.run_id != first.run_id


def test_a_data_set_that_another_process_logs_at_once_is_asked_for_again(settings, monkeypatch):
    data = DatasetInfo("skin", "0123", "training")
    with Run.begin(settings, "key", "name") as run:
        log, said = run.client.log_inputs, ["UNIQUE constraint failed: datasets.name", None]

        def between(*words, **more):
            if problem := said.pop(0):
                raise MlflowException(problem)
            log(*words, **more)

        monkeypatch.setattr(run.client, "log_inputs", between)
        run.dataset(data)
        said[:] = ["disk full"]
        with pytest.raises(MlflowException, match="disk full"):
            run.dataset(data)
    (seen,) = info(settings, run.run_id).inputs.dataset_inputs
    assert seen.dataset.name == "skin"


BEGIN_AND_DIE = """
import os, signal, sys
from pathlib import Path
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
run = Run.begin(TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "test"), "killed", "name")
print(run.run_id, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_run_is_mended_at_the_next_start_and_a_living_one_left_alone(settings):
    living = Run.begin(settings, "living", "name")
    dead = subprocess.run([sys.executable, "-c", BEGIN_AND_DIE], capture_output=True, text=True, check=False)
    assert dead.returncode == -signal.SIGKILL
    run_id = dead.stdout.strip()
    assert info(settings, run_id).info.status == "RUNNING"
    Run.begin(settings, "other", "name").end("FINISHED")
    assert info(settings, run_id).info.status == "KILLED"
    assert info(settings, living.run_id).info.status == "RUNNING"


def test_metrics_wait_and_are_written_together(settings):
    with Run.begin(settings, "key", "name") as run:
        for epoch in range(1500):
            run.metrics({"loss": 1.0 / (epoch + 1)}, epoch)
        assert info(settings, run.run_id).data.metrics == {}
        run.metrics({"best": 0.5})
    client = open_store(settings.database)
    assert len(client.get_metric_history(run.run_id, "loss")) == 1500
    assert info(settings, run.run_id).data.metrics["best"] == 0.5


def test_the_whole_configuration_is_kept_where_parameters_are_cut(settings):
    long = list(range(200))
    with Run.begin(settings, "key", "name") as run:
        run.parameters({"model": {"name": "paper", "long": long}, "seed": 3})
        run.parameters({"model": {"name": "paper", "long": long}, "seed": 3})
    assert info(settings, run.run_id).data.params == {"model.name": "paper", "seed": "3"}
    kept = fetch(settings, run.run_id, "config.yaml").read_text()
    assert "199" in kept


def test_what_a_run_does_not_have_is_said_in_one_line(settings):
    with pytest.raises(UserError, match="has no model"):
        fetch(settings, "0" * 32, "model/model.pt")


def test_nested_configurations_flatten():
    assert flattened({"a": {"b": 1, "c": {"d": None}}, "e": [1]}) == {"a.b": 1, "a.c.d": None, "e": [1]}


def test_an_older_database_is_brought_up_to_date_aside(workplace):
    database = workplace / "runs" / "mlflow.db"
    stamp = database.with_name("mlflow.db.version")
    stamp.write_text("0.0.1")
    before = database.stat().st_ino
    ensure_database(database)
    assert stamp.read_text() != "0.0.1"
    assert database.stat().st_ino != before
    assert not database.with_name("mlflow.db.new").exists()


def test_several_processes_may_ask_for_a_fresh_database_at_once(tmp_path):
    code = "from pathlib import Path; from ertskin.tracking.store import open_store; open_store(Path('new/mlflow.db'))"
    asking = [subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=os.environ) for _ in range(2)]
    assert [process.wait(timeout=120) for process in asking] == [0, 0]
