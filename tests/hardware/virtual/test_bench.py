"""The bench as a whole: plans, determinism, hidden effects, recordings, seals, real time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from ertskin.hardware.description import protocol_of, sensor_of
from ertskin.hardware.recording import read_recording
from ertskin.hardware.validate import rest_quality
from ertskin.hardware.virtual.bench import (
    BAD_RIG,
    EFFECTS,
    FAST,
    Bench,
    LiveSkin,
    Noise,
    Truth,
    draw_truth,
    write_bench,
)
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.hardware.virtual.bench.plans import PLANS, WEIGHT_N, presses
from ertskin.hardware.virtual.bench.repeatability import Repeatability
from ertskin.hardware.virtual.bench.sealing import SealError, seal, unseal
from ertskin.hardware.virtual.bench.strength import Ruler
from ertskin.physics.history import History, Phase

SENSOR = nominal_sensor()
SILENT = Noise(white_v=0.0, force_n=0.0)
OFF = Noise(landing_m=6e-4)
SHORT = presses(SENSOR.taxel_m[[7, 8]], np.array([1e-3, 3e-3]), holds=1)


def run(truth: Truth, history: History = SHORT) -> tuple[np.ndarray, np.ndarray]:
    frames = Bench(truth, resolution=FAST).frames(history, "test", ideal=True)
    return frames.voltage_v.astype(float), frames.history.force_n


@pytest.fixture(scope="module")
def bare_run() -> tuple[np.ndarray, np.ndarray]:
    return run(draw_truth(SENSOR, 1))


@pytest.mark.parametrize(
    ("plan", "recording"),
    [("indentation", "rig_a_train"), ("test_one", "rig_a_test_one"), ("test_two", "rig_a_test_two")],
)
def test_plans_are_those_of_the_recordings(plan: str, recording: str, shared_data: Path):
    frames = read_recording(shared_data / "recordings" / f"{recording}.h5").frames
    assert frames is not None
    real, ours = frames.history, PLANS[plan](SENSOR)
    np.testing.assert_array_equal(ours.press, real.press)
    np.testing.assert_array_equal(ours.phase, real.phase)
    np.testing.assert_allclose(ours.time_s, real.time_s)
    np.testing.assert_allclose(ours.contact_m, real.contact_m, atol=1e-12)
    np.testing.assert_allclose(ours.depth_m, real.depth_m, atol=1e-12)


def test_nominal_sensor_is_that_of_the_recordings(shared_data: Path):
    sensor = read_recording(shared_data / "recordings" / "rig_a_train.h5").sensor
    assert sensor is not None
    np.testing.assert_allclose(SENSOR.electrode_center_m, sensor.electrode_center_m, atol=1e-12)
    np.testing.assert_allclose(SENSOR.taxel_m, sensor.taxel_m, atol=1e-12)
    assert SENSOR.layers == sensor.layers


def test_a_bare_skin_repeats_itself_and_remembers_nothing(bare_run: tuple[np.ndarray, np.ndarray]):
    voltage, force = bare_run
    rest = SHORT.phase == Phase.REST
    np.testing.assert_allclose(voltage[rest], voltage[[0, 0, 0]], atol=1e-6)
    up, down = SHORT.phase == Phase.LOADING, SHORT.phase == Phase.UNLOADING
    np.testing.assert_allclose(voltage[up][0], voltage[down][0], atol=1e-6)
    np.testing.assert_allclose(force[up][0], force[down][0], rtol=1e-6)
    assert np.abs(voltage[up] - voltage[0]).max() > 0.02


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_shows_and_fades_with_its_strength(name: str, bare_run: tuple[np.ndarray, np.ndarray]):
    """The signal moves, and clearly less at a quarter of the strength. A spot is put where it is pressed."""
    local = {"torn_patch", "delaminated_spot"}
    history = presses(SENSOR.taxel_m[[9]], np.array([1e-3, 3e-3]), holds=1) if name in local else SHORT
    bare = run(draw_truth(SENSOR, 1), history) if name in local else bare_run
    change = []
    for strength in (1.5, 6.0) if name == "frozen_channel" else (0.25, 1.0):
        truth = draw_truth(SENSOR, 1, {name: strength})
        if name == "intermittent_electrode":
            truth.effects[name]["parameters"]["share"] = 1.0
        if name in local:
            truth.effects[name]["parameters"]["center_m"] = SENSOR.taxel_m[9].tolist()
        voltage, force = run(truth, history)
        change.append([np.sqrt(np.mean((voltage - bare[0]) ** 2)), np.sqrt(np.nanmean((force - bare[1]) ** 2))])
    weak, strong = np.array(change)
    assert strong[0] > 2e-5 or strong[1] > 1e-2
    if name != "frozen_channel":
        assert (weak[strong > [2e-5, 1e-2]] < 0.7 * strong[strong > [2e-5, 1e-2]]).all()


def test_effects_leave_the_rest_of_the_skin_as_it_was():
    bare, hidden = draw_truth(SENSOR, 3), draw_truth(SENSOR, 3, {"crosstalk": 1.0})
    assert replace(hidden, effects={}) == bare
    assert draw_truth(SENSOR, 4).contact_ohm != bare.contact_ohm


def test_an_effect_the_bench_has_not_is_refused():
    with pytest.raises(KeyError, match="moon_phase"):
        draw_truth(SENSOR, 1, {"moon_phase": 1.0})


def test_two_weights_press_with_their_weight():
    history = PLANS["test_two"](SENSOR)[np.arange(3)]
    truth = draw_truth(SENSOR, 1, noise=replace(SILENT, placement_m=1e-3))
    frames = Bench(truth, resolution=FAST).frames(history, "weights")
    np.testing.assert_allclose(frames.history.force_n[1:], WEIGHT_N)
    assert frames.history.force_n[0, 0] == 0.0


def test_a_stage_lands_beside_its_place_by_as_much_as_it_is_given():
    steady, loose = (Repeatability(draw_truth(SENSOR, 1, noise=noise), "a") for noise in (Noise(), OFF))
    place, landed = np.array([[0.03, 0.04]]), []
    for _ in range(400):
        steady.next_press()
        loose.next_press()
        assert np.array_equal(steady.landed_m(place), place)
        assert np.array_equal(loose.landed_m(place), loose.landed_m(place))
        landed.append(loose.landed_m(place) - place)
    assert np.std(landed) == pytest.approx(OFF.landing_m, rel=0.1)


def test_noise_has_the_size_it_was_given():
    history = presses(SENSOR.taxel_m[[7]], np.array([1e-3]), holds=0)
    for noise in (Noise(), Noise(coloured_share=0.5)):
        truth = draw_truth(SENSOR, 1, noise=noise)
        bench = Bench(truth, resolution=FAST)
        error = bench.frames(history, "a").voltage_v - bench.frames(history, "a", ideal=True).voltage_v
        assert error.std() == pytest.approx(2e-3, rel=0.05)
        neighbours = np.corrcoef(error[:, :-1].ravel(), error[:, 1:].ravel())[0, 1]
        assert neighbours == pytest.approx(0.97 * noise.coloured_share, abs=0.05)


def test_contacts_of_a_bad_rig_walk_from_press_to_press():
    truth = draw_truth(SENSOR, 1, noise=replace(BAD_RIG, spike_share=0.0))
    frames = Bench(truth, resolution=FAST).frames(SHORT, "bad", ideal=True)
    first, second = (frames.voltage_v[SHORT.phase == Phase.REST][number] for number in (0, 1))
    assert 2e-3 < np.abs(first - second).std() < 2e-2


def test_recording_comes_back_from_disk_the_same_for_the_same_seed(tmp_path: Path):
    for name in ("a.h5", "b.h5"):
        write_bench(
            tmp_path / name, "test_two", {"piezo_hysteresis": 1.0}, 5, resolution=FAST, sealed_in=tmp_path / "s"
        )
    first, second = read_recording(tmp_path / "a.h5"), read_recording(tmp_path / "b.h5")
    assert first.frames is not None
    assert second.frames is not None
    assert first.specimen is not None
    np.testing.assert_array_equal(first.frames.voltage_v, second.frames.voltage_v)
    assert first.frames.voltage_v.shape == (16, 276, 24)
    assert first.specimen.cycle.max() == 4
    truth, about = unseal(tmp_path / "a.h5", tmp_path / "s")
    assert truth == draw_truth(SENSOR, 5, {"piezo_hysteresis": 1.0})
    assert about == {}


def test_a_seal_that_was_tampered_with_is_not_opened(tmp_path: Path):
    path = tmp_path / "x.h5"
    seal(path, draw_truth(SENSOR, 1), tmp_path / "s", {"kind": "null"})
    hidden = tmp_path / "s" / "x.truth.json"
    hidden.write_text(hidden.read_text().replace("null", "pair"))
    with pytest.raises(SealError, match="not the truth"):
        unseal(path, tmp_path / "s")
    with pytest.raises(SealError, match="no seal"):
        unseal(tmp_path / "y.h5", tmp_path / "s")


def test_live_skin_agrees_with_the_recorded_one(bare_run: tuple[np.ndarray, np.ndarray]):
    live = LiveSkin(draw_truth(SENSOR, 1, noise=SILENT), resolution=FAST)
    assert live.advance(1.0, None, 0.0) == 0.0
    np.testing.assert_allclose(live.scan(1.0), bare_run[0][0], atol=2e-4)
    force = live.advance(2.0, SENSOR.taxel_m[7], 3e-3)
    assert force == pytest.approx(bare_run[1][2, 0], rel=1e-6)
    np.testing.assert_allclose(live.scan(2.0), bare_run[0][2], atol=2e-4)
    assert live.advance(3.0, SENSOR.taxel_m[7], -1e-3) == 0.0
    np.testing.assert_allclose(live.scan(3.0), bare_run[0][0], atol=2e-4)


def test_weights_laid_live_weigh_as_in_a_recorded_run():
    truth = draw_truth(SENSOR, 1, {"piezo_creep": 1.0}, SILENT)
    history = PLANS["test_two"](SENSOR)[:3]
    wanted = Bench(truth, resolution=FAST).frames(history, "test", ideal=True).voltage_v
    live = LiveSkin(truth, resolution=FAST)
    live.advance(0.0, None, 0.0)
    got = [live.scan(history.time_s[0])]
    for number in (1, 2):
        # The recorded run's weights lie from its stage's moving time before the scan on.
        live.lay(history.time_s[number] - 0.1, history.contact_m[number], WEIGHT_N)
        got.append(live.scan(history.time_s[number]))
        live.lay(history.time_s[number] + (live.protocol.scan_s or 0.0), None)
    assert np.abs(wanted[1] - wanted[0]).max() > 0.1
    np.testing.assert_allclose(got, wanted, atol=3e-4)


def test_runs_for_different_purposes_do_not_share_their_noise():
    truth = draw_truth(SENSOR, 1)
    first, again, other = (LiveSkin(truth, resolution=FAST, purpose=name).scan(0.0) for name in ("a", "a", "b"))
    np.testing.assert_array_equal(first, again)
    assert np.std(first - other) == pytest.approx(np.sqrt(2.0) * truth.noise.white_v, rel=0.05)


def test_only_the_scan_after_a_step_is_skewed():
    live = LiveSkin(draw_truth(SENSOR, 1, {"scan_skew": 1.0}, SILENT), resolution=FAST)
    live.advance(1.0, SENSOR.taxel_m[7], 1e-3)
    live.advance(1.5, SENSOR.taxel_m[7], 2e-3)
    gliding, resting, again = (live.scan(time_s) for time_s in (1.5, 2.0, 2.5))
    assert np.abs(gliding - resting).max() > 1e-3
    np.testing.assert_allclose(again, resting, atol=2e-4)


def test_the_ruler_finds_the_strength_for_a_ratio():
    ruler = Ruler(2, taxels=(7, 16))
    strength, reached = ruler.strength("channel_gain", 1.5)
    assert reached.own == pytest.approx(1.5, abs=0.03)
    assert ruler.measure({"channel_gain": 0.5 * strength}).own == pytest.approx(np.sqrt(1 + 1.25 / 4), abs=0.03)
    assert ruler.measure({}).own == pytest.approx(1.0, abs=1e-3)


def test_a_skin_whose_driven_electrodes_are_not_read() -> None:
    """The adjacent scheme of 16 electrodes as the configuration describes it: 208 readings of 256."""
    fields = yaml.safe_load((Path(__file__).parents[3] / "conf" / "sensor" / "adjacent16.yaml").read_text())
    sensor = sensor_of(fields)
    protocol = protocol_of(fields["protocol"], sensor.electrodes)
    assert protocol.count == 208
    bench = Bench(draw_truth(sensor, 3, {"crosstalk": 1.0}), sensor, protocol, FAST)
    frames = bench.frames(presses(sensor.taxel_m[:1], np.array([2e-3])), "one press")
    assert np.array_equal(np.isnan(frames.voltage_v), np.broadcast_to(~protocol.measured, frames.voltage_v.shape))
    quality = rest_quality(protocol.filled(frames.voltage_v.astype(float)), protocol)
    assert quality.noise_v == pytest.approx(2e-3, rel=0.2)
