"""Changes are counted from the right zero, and belong to the right taxels."""

from dataclasses import replace

import numpy as np
import pytest

from ertskin.data import touches as module
from ertskin.data.baseline import rest_weights
from ertskin.data.simulated import correcting
from ertskin.data.touches import touches_of
from ertskin.errors import UserError
from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import taxel_grid_m

PROTOCOL = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
GRID = taxel_grid_m((0.06, 0.06), 3, 3)
PAIRS = 15


def recording(drift_ohm=0.0, seed=0):
    """Twelve presses of a rest and two loaded frames; the pair resistances wander with time by ``drift_ohm``."""
    rng = np.random.default_rng(seed)
    phase = np.tile([0, 1, 1], 12).astype(np.uint8)
    press = np.repeat(np.arange(12), 3)
    force = np.tile([0.0, 1.0, 2.0], 12)
    taxel = rng.integers(0, 9, 12)[press]
    contact = np.where(phase[:, None] > 0, GRID[taxel], np.nan)[:, None]
    time = np.arange(36.0)
    resistance = 1e4 + np.outer(force, np.linspace(-50, 50, PAIRS)) + drift_ohm * np.sin(time / 12)[:, None]
    voltage = PROTOCOL.readings(resistance) + 1e-5 * rng.standard_normal((36, *PROTOCOL.shape))
    history = History(time, press, phase, contact, np.full((36, 1), np.nan), force[:, None])
    frames = Frames(voltage.astype(np.float32), history)
    return Recording(rig="test", created="", comment="", sensor=None, protocol=PROTOCOL, frames=frames)


@pytest.mark.parametrize("drift_ohm", [0.0, 300.0])
def test_the_zero_follows_a_baseline_that_wanders(drift_ohm):
    touches = touches_of(recording(drift_ohm))
    force = touches.history.force_n[:, 0]
    expected = PROTOCOL.whitened(np.outer(force, np.linspace(-50, 50, PAIRS)))
    error = np.sqrt(np.mean((touches.change_v - expected) ** 2))
    assert error < (
        3e-5 if drift_ohm == 0 else 0.2 * np.sqrt(np.mean(PROTOCOL.whitened(np.full(PAIRS, drift_ohm)) ** 2))
    )


def test_a_quiet_baseline_is_averaged_over_all_rest_frames():
    quiet, wandering = recording(0.0), recording(300.0)
    for run, spread in ((quiet, 12), (wandering, 2)):
        coordinates = run.frames.voltage_v.reshape(36, -1).astype(float) @ PROTOCOL.orthonormal
        weights = rest_weights(run.frames.history, coordinates)
        assert weights.sum(axis=1) == pytest.approx(1)
        assert (weights > 0).sum(axis=1).max() >= spread if run is quiet else (weights > 0).sum(axis=1).max() <= spread


def test_forces_lie_on_the_taxels_pressed():
    touches = touches_of(recording())
    label = touches.force_map_n(GRID, 5e-3)
    assert np.array_equal(GRID[label.argmax(axis=1)], touches.history.contact_m[:, 0])
    assert label.sum(axis=1) == pytest.approx(touches.history.force_n[:, 0])
    with pytest.raises(UserError, match="choose the recording's grid"):
        touches.force_map_n(taxel_grid_m((0.06, 0.06), 2, 2), 2e-3)


def test_rest_frames_come_along_when_asked_for():
    assert len(touches_of(recording())) == 24
    assert len(touches_of(recording(), rests=True)) == 36


def test_readings_lost_or_never_taken_change_no_touch():
    whole = recording()
    measured = np.ones(PROTOCOL.shape, dtype=bool)
    measured[3, 4] = measured[7, 1] = False
    protocol = replace(PROTOCOL, measured=measured)
    voltage = protocol.gapped(whole.frames.voltage_v)
    voltage[5, 2, 3] = voltage[8, 9, 0] = np.nan
    voltage[10, 1:] = np.nan
    frames = Frames(voltage.astype(np.float32), whole.frames.history)
    touches = touches_of(replace(whole, protocol=protocol, frames=frames))
    assert len(touches) == 23
    assert np.isfinite(touches.readings_v).all()
    assert not touches.readings_v.reshape(-1, *PROTOCOL.shape)[:, ~measured].any()
    expected = np.outer(touches.history.force_n[:, 0], np.linspace(-50, 50, PAIRS))
    assert np.sqrt(np.mean((touches.change_v - protocol.whitened(expected)) ** 2)) < 2e-5


def test_spikes_are_looked_for_once_in_each_recording(monkeypatch):
    looked, despiked = [], module.despiked
    monkeypatch.setattr(module, "despiked", lambda *given: looked.append(1) or despiked(*given))
    one, other = recording(), recording(seed=1)
    first, again, different = (touches_of(which).change_v for which in (one, one, other))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, different)
    assert len(looked) == 2


def test_a_press_corrects_by_what_rises_or_by_what_is_held_where_nothing_does():
    """Imported recordings hold one scan a press; a press added later is none the less read as it comes."""
    touches = touches_of(recording())
    assert len(correcting(touches)) == len(touches)

    def changed(**fields):
        return correcting(replace(touches, history=replace(touches.history, **fields))).history

    held = np.full(len(touches), Phase.HOLD, dtype=np.uint8)
    assert len(changed(phase=held)) == len(touches)
    first = touches.history.press == touches.history.press[0]
    added = np.where(first & (np.arange(len(touches)) == 0), Phase.LOADING, held).astype(np.uint8)
    found = changed(phase=added)
    assert (found.press == touches.history.press[0]).sum() == 1
    assert len(found) == len(touches) - (first.sum() - 1)
    unknown = np.where(first[:, None], np.nan, touches.history.force_n)
    assert not np.isin(touches.history.press[0], changed(phase=held, force_n=unknown).press)
    assert len(changed(phase=held, force_n=unknown)) == len(touches) - first.sum()
