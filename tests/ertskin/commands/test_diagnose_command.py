"""``ertskin diagnose`` of one recording or many: the same files wherever they were made."""

import json
import shutil
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from ertskin import cli
from ertskin.commands.diagnose import next_commands
from ertskin.diagnosis.contract.claims import Diagnosis, HeldOut
from ertskin.diagnosis.criteria import Criteria
from ertskin.hardware.recording import write_recording

sys.path.insert(0, str(Path(__file__).parents[2] / "hardware"))
from example_recording import example

NAMES = ("first", "second", "third")


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    """Recordings that hold neither scans nor a coupon, so that a diagnosis is quick: there is none."""
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(NAMES):
        write_recording(Path(f"{name}.h5"), replace(example(seed), frames=None, coupon=None))
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the pages, which name the folder they lie in."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix != ".html")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_many_at_once_give_what_one_by_one_gives(recordings, capsys):
    for name in NAMES:
        assert cli.main(["diagnose", f"recording={name}.h5", f"out=single/{name}"]) == 0
    written = contents(Path("runs/conf"))
    shutil.rmtree("runs/conf")
    assert cli.main(["diagnose", "recording=*.h5", "out=many", "cluster.workers=2"]) == 0
    assert contents(Path("many")) == contents(Path("single"))
    assert contents(Path("runs/conf")) == written
    assert json.loads(Path("many/second/diagnosis.json").read_text())["verdict"] == "cannot_tell"
    assert capsys.readouterr().out.count("cannot_tell") == 2 * len(NAMES)


def test_a_bad_file_costs_only_itself(recordings, capsys):
    Path("second.h5").write_bytes(b"no recording")
    assert cli.main(["diagnose", "recording=[first.h5,second.h5]", "out=many", "cluster.workers=1"]) == 1
    assert Path("many/first/diagnosis.json").is_file()
    assert not Path("many/second").exists()
    shown = capsys.readouterr()
    assert "FAILED" in shown.out
    assert shown.err.endswith("1 of 2 recordings could not be diagnosed\n")


def test_dask_gives_the_same(recordings):
    pytest.importorskip("distributed", reason="Dask is an extra: pip install 'ertskin[cluster]'")
    assert cli.main(["diagnose", "recording=[first.h5,third.h5]", "out=here", "cluster.workers=1"]) == 0
    assert cli.main(["diagnose", "recording=[first.h5,third.h5]", "out=there", "cluster=dask"]) == 0
    assert contents(Path("there")) == contents(Path("here"))


@pytest.mark.parametrize("asked", ["recording='nothing*.h5'", "recording=[first.h5,./first.h5]"])
def test_what_cannot_be_asked_is_said(recordings, capsys, asked):
    assert cli.main(["diagnose", asked]) == 2
    assert "recording" in capsys.readouterr().err


def test_the_criteria_asked_for_are_the_ones_decided_by(recordings):
    mine = Path("runs/conf/criteria/mine.yaml")
    mine.parent.mkdir(parents=True)
    mine.write_text("# Asks more of a name.\ndefaults: [default]\nsignificant_gain: 30.0\n")
    assert cli.main(["diagnose", "recording=first.h5", "out=own", "criteria=mine", "criteria.chance=0.01"]) == 0
    said = json.loads(Path("own/diagnosis.json").read_text())["criteria"]
    assert said == asdict(Criteria(significant_gain=30.0, chance=0.01))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("criteria.chance=2", "criteria.chance must be at most 0.5, not 2.0"),
        ("criteria.material_ratio=much", "criteria.material_ratio must be a number, not 'much'"),
    ],
)
def test_a_criterion_out_of_its_limits_gets_one_line(recordings, capsys, asked, said):
    assert cli.main(["diagnose", "recording=first.h5", asked]) == 2
    assert capsys.readouterr().err == f"ertskin: {said}\n"
    assert not Path("runs/diagnose").exists()


def test_the_press_that_would_settle_it_is_said_with_the_recording_it_goes_to():
    unexplained = Diagnosis("a.h5", "unexplained", HeldOut("split", None, 2.0, 2.0, None, None))
    said = next_commands(Path("a.h5"), "a", Path("out"), unexplained, 1)
    assert [line.split()[1] for line in said] == ["doctor", "train"]
    asking = replace(unexplained, next_press={"press": []})
    *others, press = next_commands(Path("a.h5"), "a", Path("out"), asking, 1)
    assert tuple(others) == said
    assert press == f"ertskin record rig=NAME sensor=NAME plan={Path('out/diagnosis.json')} recording=a.h5"
    assert next_commands(Path("a.h5"), "a", Path("out"), asking, 2) == said
