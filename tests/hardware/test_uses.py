"""What recordings can be used for, and what the others lack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from example_recording import example

from ertskin.hardware.recording import read_recording
from ertskin.hardware.uses import uses_of


def because(recording, name: str) -> str | None:
    """Why a recording can't be used for something; None where it can."""
    use = next(use for use in uses_of(recording) if use.name == name)
    return None if use.able else use.because


def test_a_whole_recording_is_of_every_use_but_for_two_contacts() -> None:
    lacking = {use.name for use in uses_of(example()) if not use.able}
    assert lacking == {"evaluate: two contacts", "diagnose: readings"}
    assert because(example(), "diagnose: readings") == "1 presses, 3 at least to hold some out"


def test_what_is_missing_is_named() -> None:
    whole = example()
    assert whole.frames is not None
    assert whole.sensor is not None
    history = whole.frames.history
    forceless = replace(whole.frames, history=replace(history, force_n=np.full_like(history.force_n, np.nan)))
    assert because(replace(whole, frames=forceless), "evaluate: one contact") == (
        "no known force of one contact at a known place"
    )
    assert because(replace(whole, frames=forceless), "diagnose: force stage") == "no force with a known depth"
    assert because(replace(whole, specimen=None), "synthesize, train") == "no /specimen"
    bare = replace(whole, sensor=replace(whole.sensor, taxel_m=np.zeros((0, 2))))
    train = next(use for use in uses_of(bare) if use.name == "synthesize, train")
    assert train.able
    assert "grid=" in train.because


def test_real_recordings(shared_data: Path) -> None:
    tank = read_recording(shared_data / "real" / "ktc2023_tank_a.h5")
    assert {use.name for use in uses_of(tank) if use.able} == {
        "calibrate: contact resistances",
        "live: play",
        "diagnose: tank",
    }
    specimen = read_recording(shared_data / "real" / "velostat_5n.h5")
    assert {use.name for use in uses_of(specimen) if use.able} == {
        "calibrate: piezoresistive law",
        "diagnose: specimen stage",
    }
    two = read_recording(shared_data / "recordings" / "rig_a_test_two.h5")
    assert because(two, "evaluate: two contacts") is None
    assert because(two, "evaluate: one contact") is not None
