"""The main job as a person runs it, small: a bench recording goes in, a table and a report come out."""

import json
import subprocess
import sys

import pytest
from hydra import compose, initialize_config_dir

from ertskin.commands import run
from ertskin.configuration import config_dir
from hardware.virtual.bench import FAST, write_bench

SMALL = [
    "data=smoke",
    "data.plan.steps=30",
    "data.plan.trials=1500",
    "data.plan.denoiser_trials=60",
    "models=[reciprocal]",
    "seeds=[0]",
    "jobs=1",
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Training and test recordings of one simulated skin with something hidden in it."""
    folder = tmp_path_factory.mktemp("bench")
    for kind in ("half", "test_two"):
        write_bench(folder / f"{kind}.h5", kind, {"sheet_inhomogeneity": 1.0}, seed=3, resolution=FAST)
    return folder


def ertskin(*words, folder):
    return subprocess.run(
        [sys.executable, "-m", "ertskin.cli", *map(str, words)], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.timeout(600)
def test_the_main_job_learns_and_goes_on_from_what_is_there(bench, tmp_path):
    words = ["run", f"recording={bench / 'half.h5'}", f"two={bench / 'test_two.h5'}", *SMALL]
    first = ertskin(*words, folder=tmp_path)
    assert first.returncode == 0, first.stdout + first.stderr
    for step in ("doctor", "calibrate", "synthesize", "train -m", "evaluate"):
        assert f"$ ertskin {step}" in first.stdout
    results = json.loads((tmp_path / "runs/evaluate/half/evaluation.json").read_text())
    exact = scores(results, "exact_rate_two")
    assert exact["reciprocal"] >= 0.6
    assert exact["mean"] == 0.0
    assert (tmp_path / "runs/evaluate/half/report.html").stat().st_size > 100_000
    again = ertskin(*words, folder=tmp_path)
    assert again.returncode == 0, again.stdout + again.stderr
    assert "done before" in again.stdout


def scores(results, metric):
    found = {method["name"]: method["seeds"][0]["metrics"] for method in results["methods"]}
    return {name: metrics[metric]["value"] for name, metrics in found.items() if metric in metrics}


def test_without_a_recording_the_rig_records_what_is_missing(tmp_path, monkeypatch):
    steps = []

    def recorded(words):
        steps.append(words)
        plans = dict(word.split("=", 1) for word in words[2:])["plan"].split(",")
        into = dict(word.split("=", 1) for word in words[2:])["recording"]
        for plan in plans:
            path = tmp_path / into.replace("${hydra:runtime.choices.plan}", plan)
            path.parent.mkdir(exist_ok=True, parents=True)
            path.touch()

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run, "run_step", recorded)
    monkeypatch.setattr(run, "_handed_on", lambda: ["rig.seed=7", "model.width=3"])
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("run", ["jobs=1", "rig.seed=7"])
    files = run._recorded(config)
    assert steps[0][:3] == ["record", "-m", "plan=quick,one_point_test,two_point_test"]
    assert steps[0][4:] == ["rig.seed=7"]
    assert all(path.is_file() for path in files.values())
    files["one"].unlink()
    assert run._recorded(config) == files
    assert steps[1][2] == "plan=one_point_test"
    assert run._recorded(config) == files
    assert len(steps) == 2


def test_a_recording_that_is_none_gets_one_line(tmp_path):
    (tmp_path / "broken.h5").write_bytes(b"not a recording")
    failed = ertskin("run", "recording=broken.h5", folder=tmp_path)
    assert failed.returncode == 1
    assert "broken.h5" in failed.stderr
    assert "Traceback" not in failed.stderr


def test_tests_without_a_training_recording_are_refused(tmp_path):
    failed = ertskin("run", "one=somewhere.h5", folder=tmp_path)
    assert failed.returncode == 2
    assert failed.stderr.strip().endswith("give recording=FILE too")
