"""The MLflow database: made once, brought up to date once, however many processes ask at the same time."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock

from ertskin.errors import JobFailed

if TYPE_CHECKING:
    from mlflow import MlflowClient


def store_uri(database: Path) -> str:
    """MLflow's address of the SQLite file."""
    return f"sqlite:///{database.resolve()}"


def ensure_database(database: Path) -> None:
    """Make the database, or bring an older MLflow's up to date; an interrupted attempt leaves the old one whole.

    MLflow itself crashes when several processes open a fresh database at once, and migrates in place.
    """
    stamp = database.with_name(database.name + ".version")
    if _is_current(database, stamp):
        return
    database.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(str(database) + ".lock"):
        if _is_current(database, stamp):
            return
        aside = database.with_name(database.name + ".new")
        aside.unlink(missing_ok=True)
        if database.exists():
            shutil.copy2(database, aside)
        _upgrade(aside)
        os.replace(aside, database)
        stamp.write_text(version("mlflow"), encoding="utf-8")


def _is_current(database: Path, stamp: Path) -> bool:
    return database.is_file() and stamp.is_file() and stamp.read_text(encoding="utf-8") == version("mlflow")


def _upgrade(database: Path) -> None:
    command = [sys.executable, "-m", "mlflow", "db", "upgrade", store_uri(database)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise JobFailed(f"MLflow could not prepare its database {database}: {last}")


def open_store(database: Path) -> MlflowClient:
    """A client of the database, made first where it isn't there."""
    from mlflow import MlflowClient

    ensure_database(database)
    return MlflowClient(store_uri(database))


def is_finished(database: Path, run_id: str) -> bool:
    """Whether the database knows the run as finished; asked of the file itself, for MLflow takes seconds to load."""
    if not database.is_file():
        return False
    wanted = "SELECT 1 FROM runs WHERE run_uuid = ? AND status = 'FINISHED' AND lifecycle_stage = 'active'"
    with closing(sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        try:
            return connection.execute(wanted, (run_id,)).fetchone() is not None
        except sqlite3.DatabaseError:
            return False  # Not MLflow's, or of a version that keeps runs elsewhere: training again finds out.


def experiment_id(client: MlflowClient, name: str, artifacts: Path) -> str:
    """The experiment's id, made where it isn't there; artifacts lie under ``artifacts``, one folder a run."""
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is not None:
        return found.experiment_id
    try:
        return client.create_experiment(name, artifact_location=(artifacts.resolve() / name).as_uri())
    except MlflowException:
        # Another process was first; if that isn't the reason, the next line says so.
        found = client.get_experiment_by_name(name)
        if found is None:
            raise
        return found.experiment_id
