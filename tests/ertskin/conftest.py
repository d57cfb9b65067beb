"""Fixtures of the learning package's tests."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

# Test data made by a module of this folder is named in a configuration: both must be found.
sys.path.insert(0, str(Path(__file__).parent))
TEST_CONF = Path(__file__).parent / "conf"


@pytest.fixture(scope="session")
def fresh_database(tmp_path_factory) -> Path:
    """A folder with an empty MLflow database, which takes seconds to make: once for all workers."""
    from ertskin.tracking.store import ensure_database

    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "fresh"
    folder.mkdir(exist_ok=True)
    ensure_database(folder / "mlflow.db")
    return folder


@pytest.fixture
def workplace(tmp_path, fresh_database, monkeypatch) -> Path:
    """An empty working directory that has its database already."""
    shutil.copytree(fresh_database, tmp_path / "runs")
    monkeypatch.chdir(tmp_path)
    return tmp_path
