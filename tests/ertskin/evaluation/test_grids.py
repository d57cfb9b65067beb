"""Networks of several grids in one evaluation and one report."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_bench import write_small_bench

from ertskin import cli

pytestmark = pytest.mark.long

QUICK = [
    *("model=reciprocal", "model.network.width=16", "trainer.max_epochs=2", "trainer.accelerator=cpu"),
    *("data.plan.steps=4", "data.plan.trials=200", "data.plan.denoiser_trials=20", "data.plan.shard=50"),
]


def evaluate(*words: str) -> int:
    return cli.main(["evaluate", "recording=train.h5", "two=two.h5", "yardsticks=[mean]", "yardstick_seeds=1", *words])


def test_two_grids_stand_side_by_side_in_a_report_of_their_own(workplace, capfd):
    write_small_bench(workplace)
    assert cli.main(["train", "-m", "recording=train.h5", "grid=3x3,2x2", *QUICK]) == 0
    plan = [word for word in QUICK if word.startswith("data.")]
    capfd.readouterr()
    assert evaluate("grids=[3x3,2x2]", "one=one.h5", *plan) == 0
    said = capfd.readouterr().out
    assert "grid 2x2: judged on 2 of 8 test frames" in said
    found = json.loads(Path("runs/evaluate/train-3x3-2x2/evaluation.json").read_text())
    assert {(method["name"], method["grid"], method["kind"]) for method in found["methods"]} == {
        (f"{name} {grid}", grid, kind)
        for name, kind in (("reciprocal", "network"), ("mean", "yardstick"))
        for grid in ("3x3", "2x2")
    }
    assert set(found["about"]["data_checksum"]) == {"3x3", "2x2"}
    report = Path("runs/evaluate/train-3x3-2x2/report.html").read_text()
    assert "One grid beside another" in report
    assert "Test frames: 2x2 on 2, 3x3 on 8." in report
    for wrong, expected in (
        ("grids=[6]", "'6' is no grid"),
        ("grids=[4x4]", "train one: ertskin train recording=train.h5 grid=4x4"),
    ):
        assert evaluate(wrong, *plan) == 2
        assert expected in capfd.readouterr().err


@pytest.mark.parametrize(("within_m", "kept"), [(0.01, 1), (0.041, 2)])
def test_frames_off_the_points_are_left_out(workplace, within_m, kept):
    from ertskin.data.touches import touches_of
    from ertskin.evaluation.grids import on_points
    from ertskin.hardware.recording import read_recording

    _, _, two = write_small_bench(workplace)
    touches = touches_of(read_recording(two))
    corners_m = np.array([[0.01, 0.01], [0.05, 0.05], [0.05, 0.03]])
    assert len(on_points(touches, corners_m, within_m)) == kept
