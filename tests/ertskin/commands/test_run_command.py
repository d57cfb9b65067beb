"""The main job as a person runs it, small: a bench recording goes in, a table and a report come out."""

import json
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from small_bench import write_small_bench

from ertskin.commands import run
from ertskin.configuration import config_dir
from ertskin.data.shards import file_sha256
from ertskin.diagnosis.contract.claims import Claim, Diagnosis, Estimate, HeldOut
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.output.diagnosis_file import write_diagnosis, write_effects
from ertskin.errors import UserError
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

pytestmark = pytest.mark.long

SMALL = [
    "data=smoke",
    "data.plan.steps=30",
    "data.plan.trials=1500",
    "data.plan.denoiser_trials=60",
    "models=[reciprocal]",
    "with_effects=[contacts,reciprocal]",
    "between.settings=['data.plan.trials=200','data.table.spacing_m=0.03','data.table.forces=3','trainer.max_epochs=2']",
    "seeds=[0]",
    "jobs=1",
    "yardsticks=[mean]",
]


def ertskin(*words, folder):
    return subprocess.run(
        [sys.executable, "-m", "ertskin.cli", *map(str, words)], cwd=folder, capture_output=True, text=True, check=False
    )


def diagnosed(source: Path, folder: Path) -> None:
    """What a diagnosis of ``source`` would have left in ``folder``: a slope of the sheet."""
    claim = Claim(SheetInhomogeneity(gradient_x=0.2), 0.97, 3.0, {"gradient_x": Estimate(0.2, 0.19, 0.21, "1")})
    held = HeldOut("every third press", 2e-3, 3.1, 1.02, 1e-9)
    about = {"recording_sha256": file_sha256(source), "figures": []}
    write_diagnosis(
        folder / "runs/diagnose/train", Diagnosis("train.h5", "explained", held, claims=(claim,), extra=about)
    )
    write_effects(folder / "runs/conf", "train", (claim.effect,), "train.h5")


@pytest.mark.timeout(600)
def test_the_main_job_learns_without_and_with_what_was_found_and_goes_on_from_what_is_there(workplace):
    write_small_bench(workplace, {"sheet_inhomogeneity": 1.0})
    diagnosed(Path("train.h5"), workplace)
    first = ertskin("run", "recording=train.h5", "one=one.h5", "two=two.h5", *SMALL, folder=workplace)
    assert first.returncode == 0, first.stdout + first.stderr
    for step in ("doctor", "calibrate", "synthesize", "train -m", "evaluate"):
        assert f"$ ertskin {step}" in first.stdout
    assert "$ ertskin diagnose" not in first.stdout
    results = json.loads(Path("runs/evaluate/train/evaluation.json").read_text())
    hits = scores(results, "hit_rate_one")
    assert {"reciprocal", "contacts"} <= set(hits)
    assert {f"{name} (with sheet inhomogeneity)" for name in ("reciprocal", "contacts")} <= set(hits)
    assert hits["reciprocal"] >= 0.6
    # The mean place is the middle, one of the test's three.
    assert hits["mean"] == pytest.approx(1.0 / 3.0)
    report = Path("runs/evaluate/train/report.html").read_text()
    for words in ("What the simulator lacked", "sheet inhomogeneity", "gradient x 0.2 (0.19 to 0.21)"):
        assert words in report
    assert "What that changed for the networks" in report
    again = ertskin("run", "recording=train.h5", *SMALL, folder=workplace)
    assert again.returncode == 0, again.stdout + again.stderr
    assert again.stdout.count("done before") == 4
    assert "trained:" not in again.stdout


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
    assert steps[0][:3] == ["record", "-m", "plan=quick,one_point_test,two_point_test,anywhere_test"]
    assert steps[0][4:] == ["rig.seed=7"]
    assert all(path.is_file() for path in files.values())
    files["one"].unlink()
    assert run._recorded(config) == files
    assert steps[1][2] == "plan=one_point_test"
    assert run._recorded(config) == files
    assert len(steps) == 2


def test_a_diagnosis_by_other_criteria_does_not_stand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = Path("train.h5")
    source.write_bytes(b"the same bytes")
    diagnosed(source, tmp_path)
    assert run._diagnosis(source, DEFAULT).effects == "train"
    assert run._diagnosis(source, Criteria(chance=0.01)).folder is None


class Steps:
    """Commands that would be run: before the diagnosis is there, ``diagnose`` leaves one that names ``effects``.

    What is run meanwhile ends once more than so many others have begun.
    """

    def __init__(self, folder, monkeypatch, effects, ends_after=99):
        self.run, self.meanwhile, self.cores = [], [], []
        self.ends_after = ends_after
        self.found, self.diagnosed = run.Found(folder, effects), False
        monkeypatch.setattr(run, "run_step", self.step)
        monkeypatch.setattr(run, "meanwhile", self.aside)
        monkeypatch.setattr(run, "given_cores", lambda: 4)
        monkeypatch.setattr(run, "_diagnosis", lambda *_: self.found if self.diagnosed else run.Found())
        monkeypatch.setattr(run, "_handed_on", list)

    def step(self, words, cores=None):
        self.run.append(words)
        self.cores.append(cores)
        self.diagnosed |= words[0] == "diagnose"

    @contextmanager
    def aside(self, steps, log, cores):
        self.meanwhile += steps
        yield self

    def is_alive(self):
        return len(self.run) <= self.ends_after

    def verbs(self, words):
        return [(step[0], [word for word in step if word.startswith("effects=")]) for step in words]


def trained(*words):
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("run", list(words))
    return run._trained(config, Path("mine.h5"), DEFAULT, [], config.jobs)


WITHOUT = [("train", ["effects=none"]), ("synthesize", []), ("train", ["effects=none"])]
WITH = [("train", ["effects=mine"]), ("synthesize", ["effects=mine"]), ("train", ["effects=mine"])]
BOTH = [("train", ["effects=none,mine"]), ("synthesize", []), ("synthesize", ["effects=mine"])]
BOTH += [("train", ["effects=none,mine"])]
ALL = "with_effects=[contacts,paper]"


def test_networks_that_know_of_no_effect_are_trained_while_the_recording_is_diagnosed(tmp_path, monkeypatch):
    steps = Steps(tmp_path, monkeypatch, "mine")
    assert trained("jobs=2", ALL) == steps.found
    assert steps.verbs(steps.meanwhile) == WITHOUT
    assert steps.verbs(steps.run) == [("diagnose", []), *WITH]
    assert steps.cores == [2, 2, 2, 2]
    nothing = Steps(tmp_path, monkeypatch, None)
    trained("jobs=2", ALL)
    assert nothing.verbs(nothing.meanwhile) == WITHOUT
    assert nothing.verbs(nothing.run) == [("diagnose", [])]


def test_networks_trained_after_the_others_have_all_cores(tmp_path, monkeypatch):
    steps = Steps(tmp_path, monkeypatch, "mine", ends_after=1)
    trained("jobs=2", ALL)
    assert steps.verbs(steps.run) == [("diagnose", []), *WITH]
    assert steps.cores == [2, 2, None, None]
    assert ["hydra.launcher.n_jobs=2" in words for words in steps.run] == [False, False, False, True]


def test_one_job_does_one_thing_after_another_and_a_diagnosis_stands(tmp_path, monkeypatch):
    steps = Steps(tmp_path, monkeypatch, "mine")
    trained("jobs=1", ALL)
    assert steps.verbs(steps.run) == [("diagnose", []), *BOTH]
    steps.run.clear()
    trained("jobs=2", ALL)
    assert steps.verbs(steps.run) == BOTH
    assert not steps.meanwhile


def test_what_was_found_is_for_the_networks_asked_for(tmp_path, monkeypatch):
    steps = Steps(tmp_path, monkeypatch, "mine")
    trained("jobs=2", "models=[paper,reciprocal]", "with_effects=[contacts,reciprocal]")
    contacts, synthesized, taxels = steps.run[1:]
    assert contacts[3:6] == ["model=contacts", "seed=0", "effects=mine"]
    assert synthesized[2:] == ["effects=mine"]
    assert taxels[3:6] == ["model=reciprocal", "seed=0", "effects=mine"]
    steps.run.clear()
    trained("jobs=2", "models=[paper,reciprocal]")
    assert steps.verbs(steps.run) == [
        *[("train", ["effects=none,mine"]), ("synthesize", []), ("train", ["effects=none"])],
    ]


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("with_effects=[contcts]", "with_effects: no network 'contcts'; there are contacts, paper, places, reciprocal"),
        ("with_effects=contacts", "with_effects must be a list, as [contacts,paper] or [], not 'contacts'"),
        ("models=null", "models must be a list, as [contacts,paper] or [], not None"),
        ("between.models=[conacts]", "between.models: no network 'conacts'"),
        ("with_effects=[reciprocal]", "with_effects: reciprocal isn't trained: name it in models="),
    ],
)
def test_networks_that_there_are_not_are_said_at_once(word, said):
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("run", [word])
    with pytest.raises(UserError) as refused:
        run._known_networks(config)
    assert str(refused.value).startswith(said)


def test_without_networks_of_contacts_none_is_trained_with_effects():
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose("run", ["between.models=[]"])
    run._known_networks(config)
    assert config.with_effects == []


def test_a_recording_that_is_none_gets_one_line(tmp_path):
    (tmp_path / "broken.h5").write_bytes(b"not a recording")
    failed = ertskin("run", "recording=broken.h5", folder=tmp_path)
    assert failed.returncode == 2
    (line,) = failed.stderr.splitlines()
    assert "broken.h5" in line


def test_tests_without_a_training_recording_are_refused(tmp_path):
    failed = ertskin("run", "one=somewhere.h5", folder=tmp_path)
    assert failed.returncode == 2
    assert failed.stderr.strip().endswith("give recording=FILE too")
