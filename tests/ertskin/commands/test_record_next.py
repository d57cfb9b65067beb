"""Presses asked for one by one, on the virtual bench."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ertskin.cli import main
from ertskin.data.chosen_presses import made_presses
from ertskin.hardware.recording import Recording, read_recording

PADS = "[[0.006,0.006],[0.03,0.006],[0.054,0.006],[0.054,0.03],[0.054,0.054],[0.03,0.054],[0.006,0.054],[0.006,0.03]]"
SMALL = ["sensor.size_m=[0.06,0.06]", f"sensor.electrode_center_m={PADS}", "sensor.taxel_grid=[3,3]"]


def words(out: Path, *more: str) -> list[str]:
    """The command line for a small skin."""
    rig = [f"rig.sealed={out.parent / 'sealed'}", "rig.specimen_run={steps: 5, cycles: 1}"]
    return ["record", "plan=next", f"recording={out}", "plan.ramp.step_m=1.0e-3", *SMALL, *rig, *more]


def places(recording: Recording) -> np.ndarray:
    """(n,2) of the presses in order."""
    assert recording.frames is not None
    history = recording.frames.history
    made = made_presses(recording.frames)
    assert made.tolist() == list(range(len(made)))
    return np.array([history.contact_m[(history.press == k) & (history.phase > 0)][0, 0] for k in made])


def test_presses_are_asked_for_until_there_are_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    never = ["plan.accuracy_n=1.0e-6", "plan.accuracy_m=1.0e-9"]
    assert main(words(out, "plan.most=1", *never)) == 0
    output = capsys.readouterr().out
    assert "1 press: one contact is expected to be found to" in output
    assert "stopped at plan.most=1" in output
    first = read_recording(out)
    np.testing.assert_allclose(places(first), [[0.03, 0.03]])
    # As well known as stated: nothing is pressed, nothing changes.
    before = out.read_bytes()
    assert main(words(out, "plan.accuracy_n=20.0", "plan.accuracy_m=0.1")) == 0
    assert "as wanted, no press more" in capsys.readouterr().out
    assert out.read_bytes() == before
    # One more is added to what is there.
    assert main(words(out, "plan.most=2", *never)) == 0
    more = read_recording(out)
    assert more.frames is not None
    assert first.frames is not None
    np.testing.assert_array_equal(more.frames.voltage_v[: len(first.frames)], first.frames.voltage_v)
    place_m = places(more)
    assert len(place_m) == 2
    assert np.linalg.norm(place_m[1] - place_m[0]) > 0.015
    assert (np.diff(more.frames.history.time_s) > 0).all()


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("plan.accuracy_n=0", "plan.accuracy_n must be above 0"),
        ("plan.most=many", "plan.most must be a whole number"),
        ("plan.ramp.depth_m=-1", "plan.ramp: a ramp needs depth and step above 0"),
        ("plan.unheard_of=1", "plan.unheard_of"),
    ],
)
def test_wrong_settings_are_reported_in_a_line(
    word: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words(tmp_path / "a.h5", word if "unheard" not in word else f"+{word}")) == 2
    error = capsys.readouterr().err.strip()
    assert expected in error
    assert "\n" not in error
    assert not (tmp_path / "a.h5").exists()


def test_presses_on_another_skin_are_not_added(
    shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.h5"
    out.write_bytes((shared_data / "recordings" / "rig_c_train.h5").read_bytes())
    assert main(words(out)) == 2
    assert "no press can be added to it" in capsys.readouterr().err
