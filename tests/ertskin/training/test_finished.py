"""Finding what was trained last."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from ertskin.errors import UserError
from ertskin.tracking.settings import TrackingSettings
from ertskin.training import finished
from ertskin.training.finished import DONE, Job, finished_job, latest_job


def test_the_job_that_ended_last_is_found(tmp_path: Path) -> None:
    for name, moment_s in (("first", 100.0), ("second", 300.0), ("third", 200.0)):
        (tmp_path / name).mkdir()
        (tmp_path / name / DONE).write_text("{}")
        os.utime(tmp_path / name / DONE, (moment_s, moment_s))
    (tmp_path / "begun").mkdir()
    assert latest_job(tmp_path) == tmp_path / "second"


def test_where_nothing_was_trained_it_is_said(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="train one, or name network"):
        latest_job(tmp_path / "nowhere")


def test_a_model_of_another_version_is_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ertskin.models.reconstruction import Reconstruction

    loaded: list[Path] = []
    monkeypatch.setattr(Reconstruction, "load", loaded.append)
    monkeypatch.setattr(finished, "is_finished", lambda database, run_id: True)
    job = Job(tmp_path, "run", {"validation_hit_rate_one": 1.0})
    job.model.write_bytes(b"weights")
    job.keep()
    tracking = cast(TrackingSettings, SimpleNamespace(database="sqlite:///none.db"))
    assert finished_job(tmp_path, tracking) == job
    assert loaded == []
    os.utime(tmp_path / DONE, (100.0, 100.0))
    monkeypatch.setattr(finished, "networks_sha256", lambda: "another version")
    assert [finished_job(tmp_path, tracking) for _ in range(3)] == [job] * 3
    assert loaded == [job.model]
    assert (tmp_path / DONE).stat().st_mtime == 100.0
