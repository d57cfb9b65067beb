"""Every command that reads recordings refuses bad ones alike: in one line, in time, before it loads what it needs.

The whole corpus through every command, also where a bad recording is read: ``experiments/bench/refusals.py``.
"""

from __future__ import annotations

import subprocess
import sys
import time
from itertools import cycle
from pathlib import Path

import pytest
from small_bench import write_small_bench

from ertskin import cli
from ertskin.hardware import clean_copy, recording

sys.path.insert(0, str(Path(__file__).parents[2] / "hardware"))
from bad_recordings import REFUSED, spoilt, systematic

COMMANDS = {
    "doctor": ["doctor", "recording=bad.h5"],
    "calibrate": ["calibrate", "recording=bad.h5"],
    "diagnose": ["diagnose", "recording=bad.h5"],
    "retrain": ["diagnose", "recording=train.h5", "retrain=true", "one=bad.h5"],
    "synthesize": ["synthesize", "recording=bad.h5"],
    "train": ["train", "recording=bad.h5"],
    "evaluate": ["evaluate", "recording=bad.h5", "one=one.h5"],
    "one": ["evaluate", "recording=train.h5", "one=bad.h5"],
    "two": ["evaluate", "recording=train.h5", "two=bad.h5"],
    "anywhere": ["evaluate", "recording=train.h5", "anywhere=bad.h5"],
    "live": ["live", "recording=bad.h5", "network=model.onnx", "stream=true"],
    "run": ["run", "recording=bad.h5"],
    "record": ["record", "recording=bad.h5"],
    "import": ["import", "source=bad.h5"],
}
CASES = list(zip(list(REFUSED)[::3], cycle(COMMANDS), strict=False))
HEAVY = {"torch", "numba", "scipy", "sklearn", "mlflow", "matplotlib"}
REFUSAL_S = 2.0


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with good recordings."""
    folder = tmp_path_factory.mktemp("good")
    write_small_bench(folder)
    return folder


@pytest.fixture
def place(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory with the good recordings."""
    for path in good.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("case", "command"), CASES)
def test_a_bad_recording_is_refused_in_one_line(
    case: str, command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    spoilt(place / "train.h5", place / "bad.h5", REFUSED[case])
    # Nothing here is damaged in its bytes: the file may be taken apart in this process.
    monkeypatch.setattr(recording, "isolated_copy", lambda path: clean_copy.clean_copy(str(path)))
    begun = time.process_time()
    assert cli.main(COMMANDS[command]) == 2
    assert time.process_time() - begun < REFUSAL_S
    said = "".join(capfd.readouterr())
    assert "Traceback" not in said
    (line,) = (line for line in said.splitlines() if line.startswith("ertskin: "))
    assert "bad.h5" in line


@pytest.mark.parametrize(
    ("case", "command", "expected"),
    [
        ("frames/phase zeroed", "one", "bad.h5: no frame presses at a known place"),
        ("frames/phase constant", "two", "bad.h5: no frame presses at a known place"),
        ("frames/contact_m missing", "anywhere", "bad.h5: no frame presses at a known place"),
        ("sensor/taxel_m first alone", "synthesize", "trials of 2 contacts need as many taxels"),
    ],
)
def test_a_sound_recording_that_is_of_no_use_for_it_is_refused(
    case: str, command: str, expected: str, place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    spoilt(place / "train.h5", place / "bad.h5", dict(systematic())[case])
    assert cli.main(COMMANDS[command]) == 2
    (line,) = (line for line in capfd.readouterr().err.splitlines() if line.startswith("ertskin: "))
    assert expected in line


def loaded(status: int, words: list[str]) -> str:
    """What the command, which must end with ``status``, has loaded of what takes long, as the list's text."""
    script = (
        "import sys\nfrom ertskin import cli\n"
        f"assert cli.main(sys.argv[1:]) == {status}\n"
        f"print(sorted({HEAVY!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


# The step that refuses for ``run`` is ``doctor``; ``import`` reads files of other programs.
@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in ("run", "import")])
def test_it_is_refused_before_anything_heavy_is_loaded(command: str, place: Path) -> None:
    spoilt(place / "train.h5", place / "bad.h5", REFUSED["forces negated"])
    assert loaded(2, COMMANDS[command]) == "[]"


def test_doctor_examines_a_sound_recording_without_what_takes_long_to_load(place: Path) -> None:
    assert loaded(0, ["doctor", "recording=train.h5"]) == "[]"
