"""No bad recording gets through: refused in one line, in time, or read without harm."""

from __future__ import annotations

import time
from pathlib import Path

import h5py
import pytest
from bad_recordings import REFUSED, overwritten, spoilt, systematic
from example_recording import example

from ertskin.hardware import clean_copy
from ertskin.hardware.isolation import isolated_copy
from ertskin.hardware.recording import RecordingError, read_recording, write_recording

SYSTEMATIC = dict(systematic())


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("good") / "good.h5"
    write_recording(path, example(adc=False))
    return path


def refusal(path: Path, *, isolated: bool = False) -> str | None:
    """What reading says against a recording, in one line and in time; None where it reads."""
    begun = time.process_time()
    try:
        read_recording(path, isolated=isolated)
    except RecordingError as error:
        line = str(error)
        assert "\n" not in line
        assert str(path) in line
        assert "found" in line
        assert "expected" in line
        return line
    finally:
        assert time.process_time() - begun < 2.0
    return None


def test_the_good_one_is_read(good: Path) -> None:
    assert refusal(good) is None


@pytest.mark.parametrize("name", REFUSED)
def test_bad_recordings_are_refused(name: str, good: Path, tmp_path: Path) -> None:
    assert refusal(spoilt(good, tmp_path / "bad.h5", REFUSED[name]))


def test_no_field_however_wrong_does_harm(good: Path, tmp_path: Path) -> None:
    refused = [name for name, change in SYSTEMATIC.items() if refusal(spoilt(good, tmp_path / "bad.h5", change))]
    assert len(SYSTEMATIC) > 200
    assert len(refused) > 0.75 * len(SYSTEMATIC)


def test_what_makes_the_library_loop_for_ever_is_refused_in_time(good: Path, tmp_path: Path) -> None:
    bad = overwritten(good, tmp_path / "bad.h5", seed=296)
    begun = time.monotonic()
    with pytest.raises(RecordingError, match="comes to no end"):
        read_recording(bad)
    assert time.monotonic() - begun < 30.0


def test_overwritten_bytes_do_no_harm(good: Path, tmp_path: Path) -> None:
    for seed in range(6):
        refusal(overwritten(good, tmp_path / "bad.h5", seed), isolated=True)


def test_the_copy_apart_is_the_copy_here(good: Path) -> None:
    assert isolated_copy(good) == clean_copy.clean_copy(str(good))


def test_a_field_that_cannot_be_read_is_refused_only_where_it_is_asked_for(good: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.h5"
    bad.write_bytes(good.read_bytes())
    with h5py.File(bad, "r+") as file:
        file["frames"].create_dataset("camera", (10**6, 10**4), "f4", chunks=(1, 10**4))
    assert refusal(bad) is None
    with h5py.File(bad, "r+") as file:
        del file["sensor/taxel_m"]
        file["sensor"].create_dataset("taxel_m", (10**8, 2), "f8", chunks=(1, 2))
    assert "taxel_m: found a claim of" in (refusal(bad) or "")


def test_every_real_recording_is_accepted(shared_data: Path) -> None:
    for path in sorted((shared_data / "recordings").glob("*.h5")):
        assert refusal(path) is None
