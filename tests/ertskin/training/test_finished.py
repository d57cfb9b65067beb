"""Finding what was trained last."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ertskin.errors import UserError
from ertskin.training.finished import DONE, latest_job


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
