"""A tank's diagnosis: the electrode made to read wrong is named, none else; inclusions are where they were put."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ertskin.diagnosis.linear.sensitivity import Hats
from ertskin.diagnosis.output.figures import write_figures
from ertskin.diagnosis.output.report import write_report
from ertskin.diagnosis.tank.diagnosis import blamed, diagnose_tank
from ertskin.diagnosis.tank.electrode_error import (
    column_errors,
    corrected,
    electrode_errors,
    electrode_weights,
    rms_v,
)
from ertskin.diagnosis.tank.inclusions import Imaging, InclusionMap, bend
from ertskin.hardware.measurement import Frames, Recording
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

pytestmark = pytest.mark.long

ELECTRODES, RADIUS_M, NOISE_V = 16, 0.1, 1e-4
RESISTIVE_M, CONDUCTIVE_M, SIZE_M = np.array([-0.04, 0.02]), np.array([0.045, -0.01]), 0.025
GRID = Hats(np.zeros(2), np.ones(2), 1.0)


def tank() -> Sensor:
    """A round tank with electrodes over half of its wall."""
    corners = 192
    angle = 2 * np.pi * np.arange(corners) / corners
    outline = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first = corners // ELECTRODES * np.arange(ELECTRODES)
    edge = np.stack([outline[first], outline[first + corners // ELECTRODES // 2]], axis=1)
    return Sensor(outline, 1000.0, 10.0, electrode_edge_m=edge)


def protocol() -> Protocol:
    """Every neighbouring and every opposite pair driven both ways, neighbours read."""
    first = np.arange(ELECTRODES)
    current = np.zeros((2 * ELECTRODES, ELECTRODES))
    for block, apart in enumerate((1, ELECTRODES // 2)):
        rows = first + block * ELECTRODES
        current[rows, first] += 1e-3
        current[rows, (first + apart) % ELECTRODES] -= 1e-3
    read = np.stack([first[:-1], first[1:]], axis=1)
    return Protocol.differences(np.concatenate([current, -current]), read)


@pytest.fixture(scope="module")
def scans() -> np.ndarray:
    """(2,K,M) the tank empty and with a resistive and a conductive disk, on a finer mesh than the diagnosis's."""
    model = SheetModel(tank(), Resolution(2, Grading(4e-3, 5e-4, growth=3.0, spread=0.5)))
    place, contact_ohm = model.quadrature_m, np.random.default_rng(0).uniform(5.0, 20.0, ELECTRODES)
    ratio = np.ones(model.weight_m2.shape)
    for center_m, value in ((RESISTIVE_M, 0.1), (CONDUCTIVE_M, 10.0)):
        ratio[np.linalg.norm(place - center_m, axis=-1) < SIZE_M] = value
    pairs = [model.solve(r / 1000.0, contact_ohm).pair_resistance_ohm for r in (np.ones_like(ratio), ratio)]
    return protocol().readings(np.array(pairs))


def noisy(scan_v: np.ndarray, seed: int, spread: float = 0.3) -> np.ndarray:
    """Readings with noise whose size differs from column to column by a log-normal factor."""
    rng = np.random.default_rng(seed)
    size = NOISE_V * np.exp(spread * rng.standard_normal(scan_v.shape[-1]))
    return scan_v + size * rng.standard_normal(scan_v.shape)


def offset(scan_v: np.ndarray, electrode: int, offset_v: float) -> np.ndarray:
    """Readings with a standing error of one electrode's potential."""
    return scan_v + protocol().measurement[:, :, electrode] * offset_v


def recording(voltage_v: np.ndarray, scan: Protocol | None = None) -> Recording:
    """A recording of frames (T,K,M) in volt and nothing else."""
    count = len(voltage_v)
    history = History(
        np.arange(count, dtype=float),
        np.arange(count),
        np.zeros(count, dtype=np.uint8),
        np.full((count, 1, 2), np.nan),
        np.full((count, 1), np.nan),
        np.full((count, 1), np.nan),
    )
    return Recording("tank", "", "", tank(), scan or protocol(), Frames(voltage_v, history))


def test_good_electrodes_are_blamed_no_more_often_than_said():
    """At most one in twenty scans; 100 scans, so 10 would be beyond what chance allows (p = 0.03)."""
    silence = np.zeros(protocol().shape)
    blamed = [bool(electrode_errors(protocol(), noisy(silence, seed)).named) for seed in range(100)]
    assert sum(blamed) < 10


@pytest.mark.parametrize("electrode", [0, 7, 15])
def test_the_electrode_that_reads_wrong_is_named_alone(scans: np.ndarray, electrode: int):
    wrong = offset(noisy(scans[0], seed=1), electrode, 20 * NOISE_V)
    assert electrode_errors(protocol(), wrong).named == (electrode,)


def test_its_columns_are_mended(scans: np.ndarray):
    wrong = offset(noisy(scans[0], seed=2), 7, 20 * NOISE_V)
    for column in column_errors(protocol(), wrong, electrode_weights(protocol(), 7)):
        sign = 1 if column.channel == 7 else -1
        assert column.offset_v == pytest.approx(sign * 20 * NOISE_V, abs=4 * column.offset_error_v)
        assert not abs(column.gain) > 4 * column.gain_error
    assert rms_v(protocol(), corrected(protocol(), wrong, electrode_weights(protocol(), 7))) < 0.3 * rms_v(
        protocol(), wrong
    )


def test_inclusions_are_where_they_were_put(scans: np.ndarray):
    imaging = Imaging(tank(), protocol(), noisy(scans[0], seed=3))
    found = imaging.image(noisy(scans[1], seed=4))
    assert correlation(found) > 0.85
    assert found.at(RESISTIVE_M[None])[0] < -0.5
    assert found.at(CONDUCTIVE_M[None])[0] > 0.5
    assert np.isnan(found.at(np.array([[1.0, 1.0]]))[0])


def correlation(found: InclusionMap) -> float:
    """Of a map with the truth, over the tank."""
    x, y = np.meshgrid(*[np.linspace(-RADIUS_M, RADIUS_M, 80)] * 2)
    place = np.stack([x, y], axis=-1).reshape(-1, 2)
    place = place[np.linalg.norm(place, axis=1) < RADIUS_M]
    truth = (np.linalg.norm(place - CONDUCTIVE_M, axis=1) < SIZE_M) * 1.0
    truth -= np.linalg.norm(place - RESISTIVE_M, axis=1) < SIZE_M
    return float(np.corrcoef(found.at(place), truth)[0, 1])


@pytest.mark.parametrize(
    ("misfits", "variations", "chosen"),
    [
        ([100, 50, 10, 9], [10, 11, 12, 20], 2),
        ([100, 95, 20, 10, 9], [0, 1, 3, 4, 9], 3),
        ([100, 99, 98], [0, 5, 20], 0),
    ],
    ids=["a bend", "from an empty map", "nothing but noise"],
)
def test_the_bend_of_the_curve(misfits: list[float], variations: list[float], chosen: int):
    pairs = zip(misfits, variations, strict=True)
    maps = [InclusionMap(GRID, np.ones(4, dtype=bool), np.zeros(4), 1.0, m, v) for m, v in pairs]
    assert bend(maps) is maps[chosen]


def test_a_diagnosis_names_the_electrode_and_shows_it(scans: np.ndarray, tmp_path: Path):
    voltage = np.stack([offset(noisy(scans[0], seed), 7, 30 * NOISE_V) for seed in (5, 6)])
    findings = diagnose_tank(recording(voltage), "made up")
    diagnosis = findings.diagnosis
    assert diagnosis.electrodes == (7,)
    assert [claim.effect.name for claim in diagnosis.claims] == ["channel_gain"] * 2
    assert diagnosis.as_builtins()["effects"][0]["parameters"]["channel"]["value"] == 6
    assert diagnosis.held_out.ratio_after is not None
    assert diagnosis.held_out.ratio_before is not None
    assert diagnosis.held_out.ratio_after < 0.4 * diagnosis.held_out.ratio_before
    text = write_report(tmp_path, findings, write_figures(tmp_path, findings)).read_text(encoding="utf-8")
    assert "Which electrode reads wrong" in text
    assert "What changed" in text


def test_a_clean_tank_lacks_nothing(scans: np.ndarray):
    voltage = np.stack([noisy(scans[0], seed) for seed in (7, 8)])
    for frames in (voltage, voltage[:1]):
        diagnosis = diagnose_tank(recording(frames), "made up").diagnosis
        assert diagnosis.verdict == "no_mismatch"
        assert diagnosis.electrodes == ()


def test_recordings_that_cannot_tell_say_why(scans: np.ndarray):
    broken = scans.copy()
    broken[0, 3:] = np.nan
    few, full = slice(ELECTRODES - 1), protocol()
    bare = Protocol(full.injection_current_a[few], full.measurement[few, :1])
    for made in (recording(broken), recording(np.zeros_like(scans)), recording(scans[:, few, :1], bare)):
        diagnosis = diagnose_tank(made, "made up").diagnosis
        assert diagnosis.verdict == "cannot_tell"
        assert diagnosis.reason


def test_the_water_tanks_electrode_30(shared_data: Path):
    """Every frame of the public tank by itself names it, and no other."""
    from ertskin.hardware.recording import read_recording

    r = read_recording(shared_data / "real" / "ktc2023_tank_a.h5")
    assert r.frames is not None
    assert r.protocol is not None
    for scan in np.asarray(r.frames.voltage_v, dtype=float):
        assert electrode_errors(r.protocol, scan).named == (30,)


@pytest.mark.parametrize("error", ["gain", "dead", "reversed"])
def test_a_channel_that_reads_a_difference_is_named_and_no_electrode_for_it(scans: np.ndarray, error: str):
    channel, factor = 6, {"gain": 1.1, "dead": 0.0, "reversed": -1.0}[error]
    wrong = noisy(scans[0], seed=8, spread=0.1)
    wrong[:, channel] *= factor
    found = diagnose_tank(recording(np.stack([wrong, wrong + noisy(0 * wrong, seed=9)])), "made up").diagnosis
    assert [claim.as_builtins()["parameters"]["channel"]["value"] for claim in found.claims] == [channel]
    assert found.electrodes == (channel, channel + 1)
    assert found.claims[0].parameters["gain"].value == pytest.approx(factor - 1, abs=0.02)


def test_good_channels_and_electrodes_are_blamed_no_more_often_than_said():
    blames = [bool(blamed(protocol(), noisy(np.zeros(protocol().shape), seed)).named) for seed in range(60)]
    assert sum(blames) < 8
