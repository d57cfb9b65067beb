"""The recording file: what is written comes back to the bit, and what can't be read is refused in one line."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from example_recording import assert_same, example, undriven

from ertskin.hardware.recording import (
    Frames,
    Recording,
    RecordingError,
    read_recording,
    read_segmentation,
    write_recording,
)
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor, rectangle_m


def written(folder: Path) -> Path:
    path = folder / "example.h5"
    write_recording(path, example())
    return path


def test_comes_back_to_the_bit(tmp_path: Path) -> None:
    assert_same(example(), read_recording(written(tmp_path)))


WRITER = """
import sys, h5py
file = h5py.File(sys.argv[1], "w", libver=sys.argv[2])
file["some"] = range(1000)
print("open", flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize(("version", "locking"), [("earliest", ""), ("earliest", "TRUE"), ("latest", "")])
def test_a_file_somebody_is_writing_is_not_called_damaged(version: str, locking: str, tmp_path: Path) -> None:
    """Wherever HDF5 gives up: at the lock, at the writer's mark, at what is not written yet."""
    path = tmp_path / "busy.h5"
    words = [sys.executable, "-c", WRITER, str(path), version]
    writer = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert writer.stdin is not None
    assert writer.stdout is not None
    assert writer.stdout.readline() == "open\n"
    reader = "import sys; from ertskin.hardware.recording import read_recording; read_recording(sys.argv[1])"
    environment = {**os.environ, **({"HDF5_USE_FILE_LOCKING": locking} if locking else {})}
    words = [sys.executable, "-c", reader, str(path)]
    found = subprocess.run(words, capture_output=True, text=True, check=False, env=environment).stderr
    assert "another program writing it" in found
    if version == "latest":
        writer.kill()
        writer.wait()
        with pytest.raises(RecordingError, match="never closed"):
            read_recording(path)
    writer.communicate()


def test_same_recording_same_bytes(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.h5", example())
    write_recording(tmp_path / "b.h5", read_recording(tmp_path / "a.h5"))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_outline_edges_currents_and_differences_come_back(tmp_path: Path) -> None:
    angle = 2 * np.pi * np.arange(16) / 16
    outline = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    sensor = Sensor(outline, electrode_edge_m=np.stack([outline[::4], outline[1::4]], axis=1))
    current = 1e-3 * (np.eye(4) - np.roll(np.eye(4), 1, axis=1))
    protocol = Protocol.differences(current, np.array([[0, 1], [1, 2], [2, 3]]))
    frames = Frames(
        np.array([[[3, -1, -1], [1, 3, -1], [1, 1, 3], [-3, 1, 1]]], np.float32),
        History(
            np.zeros(1), np.zeros(1, np.int64), np.zeros(1, np.uint8), np.zeros((1, 0, 2)), *2 * [np.zeros((1, 0))]
        ),
    )
    recording = Recording("tank", "", "", sensor, protocol, frames)
    write_recording(tmp_path / "tank.h5", recording)
    assert_same(recording, read_recording(tmp_path / "tank.h5"))


@pytest.mark.parametrize("electrodes", [8, 16])
def test_readings_not_taken_and_readings_lost_come_back(electrodes: int, tmp_path: Path) -> None:
    recording = undriven(electrodes)
    path = tmp_path / "undriven.h5"
    write_recording(path, recording)
    found = read_recording(path)
    assert_same(recording, found)
    assert found.protocol is not None
    assert found.protocol.count == electrodes * (electrodes - 3)
    with h5py.File(path) as file:
        assert np.isnan(file["frames/voltage_v"][()][:, ~file["protocol/measured"][()]]).all()
        assert file["protocol/measurement"].shape == (electrodes, 2)


def test_pairs_that_differ_from_injection_to_injection_come_back(tmp_path: Path) -> None:
    """The adjacent scheme as most files hold it, 16 x 13: the same readings, without the gaps."""
    whole = undriven(16)
    assert whole.protocol is not None
    assert whole.frames is not None
    taken = whole.protocol.taken
    weights = np.stack([row[present] for row, present in zip(whole.protocol.measurement, taken, strict=True)])
    protocol = Protocol(whole.protocol.injection_current_a, weights)
    voltage = whole.frames.voltage_v[:, taken].reshape(-1, 16, 13)
    recording = dataclasses.replace(whole, protocol=protocol, frames=Frames(voltage, whole.frames.history))
    write_recording(tmp_path / "sixteen.h5", recording)
    found = read_recording(tmp_path / "sixteen.h5")
    assert_same(recording, found)
    assert found.protocol is not None
    with h5py.File(tmp_path / "sixteen.h5") as file:
        assert file["protocol/measurement"].shape == (16, 13, 2)
    one, other = (p.reciprocal(f.voltage_v[0]) for p, f in ((whole.protocol, whole.frames), (protocol, found.frames)))
    assert one == pytest.approx(other, rel=1e-9)


def test_every_shared_recording_comes_back(shared_data: Path, tmp_path: Path) -> None:
    files = [*sorted((shared_data / "recordings").glob("known_none.h5")), *sorted((shared_data / "real").glob("*.h5"))]
    files += [shared_data / "recordings" / "rig_b_test_two.h5"]
    read = [path for path in files if not path.name.startswith("eidors_")]
    assert len(read) >= 14
    for path in read:
        recording = read_recording(path)
        write_recording(tmp_path / path.name, recording)
        assert_same(recording, read_recording(tmp_path / path.name), path.name)


def test_the_tanks_truth_is_read_apart(shared_data: Path) -> None:
    truth = read_segmentation(shared_data / "real" / "ktc2023_tank_a.h5")
    assert truth.shape == (3, 256, 256)
    assert set(np.unique(truth)) <= {0, 1, 2}


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = written(tmp_path)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="already there"):
        write_recording(path, example(1))
    assert path.read_bytes() == before
    write_recording(path, example(1), overwrite=True)
    assert path.read_bytes() != before
    assert [entry.name for entry in tmp_path.iterdir()] == ["example.h5"]


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    weights = np.zeros((6, 4, 4))
    weights[:, 0, 0], weights[:, 0, 1], weights[:, 0, 2] = 1.0, -0.5, -0.5
    odd = dataclasses.replace(example().protocol, measurement=weights)  # type: ignore[type-var]
    with pytest.raises(RecordingError, match="measurement"):
        write_recording(tmp_path / "odd.h5", dataclasses.replace(example(), protocol=odd))
    assert list(tmp_path.iterdir()) == []


def _attribute(name: str, value: object) -> Callable[[h5py.File], None]:
    group, _, field = name.rpartition("/")
    return lambda file: file[group or "/"].attrs.__setitem__(field, value)


def _scaled(name: str, factor: float) -> Callable[[h5py.File], None]:
    return lambda file: file[name].__setitem__(..., file[name][()] * factor)


def _replaced(name: str, values: object, new: bool = False) -> Callable[[h5py.File], None]:
    def damage(file: h5py.File) -> None:
        if not new:
            del file[name]
        if values is not None:
            file[name] = values

    return damage


def _nan(name: str) -> Callable[[h5py.File], None]:
    def damage(file: h5py.File) -> None:
        values = file[name][()]
        values.flat[len(values.flat) // 2] = np.nan
        file[name][...] = values

    return damage


def _infinite(name: str) -> Callable[[h5py.File], None]:
    def damage(file: h5py.File) -> None:
        values = file[name][()]
        values[1, 2, 3] = np.inf
        file[name][...] = values

    return damage


def _layer(field: str, factor: float) -> Callable[[h5py.File], None]:
    def damage(file: h5py.File) -> None:
        layers = file["sensor/layers"][()]
        layers[field] *= factor
        file["sensor/layers"][...] = layers

    return damage


DAMAGE = {
    "no format": (lambda file: file.attrs.__delitem__("format"), "/format"),
    "other format": (_attribute("/format", "something"), "/format"),
    "later version": (_attribute("/format_version", 2), "/format_version"),
    "no version": (lambda file: file.attrs.__delitem__("format_version"), "/format_version"),
    "frames lost": (_replaced("frames/voltage_v", None), "/frames/voltage_v"),
    "one injection short": (_replaced("frames/voltage_v", np.zeros((5, 5, 4), "f4")), "/frames/voltage_v"),
    "one frame short": (_replaced("frames/press", np.zeros(4, int)), "/frames/press"),
    "flat voltages": (_replaced("frames/voltage_v", np.zeros(5, "f4")), "/frames/voltage_v"),
    "text for time": (_replaced("frames/time_s", np.array([b"a"] * 5)), "/frames/time_s"),
    "group for time": (lambda file: (file.__delitem__("frames/time_s"), file.create_group("frames/time_s")), "time_s"),
    "fractional press": (_replaced("frames/press", np.arange(5) + 0.5), "/frames/press"),
    "unknown phase": (_replaced("frames/phase", np.full(5, 7)), "/frames/phase"),
    "contacts differ": (_replaced("frames/force_n", np.zeros((5, 2))), "/frames/force_n"),
    "half a contact": (_nan("frames/contact_m"), "/frames/contact_m"),
    "infinite voltage": (_infinite("frames/voltage_v"), "/frames/voltage_v"),
    "no voltage at all": (_replaced("frames/voltage_v", np.full((5, 6, 4), np.nan, "f4")), "/frames/voltage_v"),
    "read where not measured": (_replaced("protocol/measured", np.eye(6, 4) == 0, new=True), "/frames/voltage_v"),
    "nothing measured": (_replaced("protocol/measured", np.zeros((6, 4), bool), new=True), "/protocol/measured"),
    "measured elsewhere": (_replaced("protocol/measured", np.ones((6, 5), bool), new=True), "/protocol/measured"),
    "pairs of no electrode": (_replaced("protocol/measurement", np.full((6, 4, 2), 4), new=True), "measurement"),
    "nan time": (_nan("frames/time_s"), "/frames/time_s"),
    "nan electrode": (_nan("sensor/electrode_center_m"), "/sensor/electrode_center_m"),
    "nan stress": (_nan("specimen/stress_pa"), "/specimen/stress_pa"),
    "nan current": (_attribute("protocol/current_a", np.nan), "/protocol/current_a"),
    "no electrode there": (_replaced("protocol/injection", np.full((6, 2), [0, 9])), "/protocol/injection"),
    "no reference": (lambda file: file["protocol"].attrs.__delitem__("reference"), "/protocol/reference"),
    "negative resistance": (_scaled("specimen/sheet_resistance_ohm_sq", -1), "/specimen/sheet_resistance_ohm_sq"),
    "clockwise": (
        lambda file: (file["sensor"].attrs.__delitem__("size_m"),
                      file["sensor"].__setitem__("outline_m", rectangle_m((1, 1))[::-1])), "/sensor/outline_m"),
    "depth in mm": (_scaled("frames/depth_m", 1e3), "/frames/depth_m"),
    "depth in um": (_scaled("frames/depth_m", 1e6), "/frames/depth_m"),
    "contacts in mm": (_scaled("frames/contact_m", 1e3), "/frames/contact_m"),
    "voltage in mV": (_scaled("frames/voltage_v", 1e3), "/frames/voltage_v"),
    "force in mN": (_scaled("frames/force_n", 1e4), "/frames/force_n"),
    "sheet in mm": (_attribute("sensor/size_m", [100.0, 60.0]), "size_m"),
    "electrodes in mm": (_scaled("sensor/electrode_center_m", 1e3), "/sensor/electrode_center_m"),
    "current in mA": (_attribute("protocol/current_a", 0.1), "current_a"),
    "modulus in MPa": (_layer("youngs_modulus_pa", 1e-6), "/sensor/layers"),
    "thickness in mm": (_layer("thickness_m", 1e3), "/sensor/layers"),
    "poisson of a half": (_layer("poissons_ratio", 2.0), "/sensor/layers"),
    "stress in MPa": (_scaled("specimen/stress_pa", 1e-6), "/specimen/stress_pa"),
    "block in mm": (_scaled("rigid_block/depth_m", 1e4), "/rigid_block/depth_m"),
    "coupon in mm": (_scaled("coupon/gap_m", 1e3), "/coupon/gap_m"),
    "sideways": (_attribute("coupon/lateral", "sometimes"), "/coupon/lateral"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_refused_in_one_line_naming_the_field(name: str, tmp_path: Path) -> None:
    path = written(tmp_path)
    damage, field = DAMAGE[name]
    with h5py.File(path, "r+") as file:
        damage(file)
    with pytest.raises(RecordingError) as refusal:
        read_recording(path)
    line = str(refusal.value)
    assert "\n" not in line
    assert str(path) in line
    assert field in line
    assert "found" in line
    assert "expected" in line


def test_files_that_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "empty.h5").touch()
    (tmp_path / "text.h5").write_text("voltage,1,2,3\n")
    for name, what in (("absent.h5", "no such file"), ("empty.h5", "0 bytes"), ("text.h5", "HDF5"), (".", "folder")):
        with pytest.raises(RecordingError, match=what):
            read_recording(tmp_path / name)


def test_a_file_cut_anywhere_is_refused(tmp_path: Path) -> None:
    whole = written(tmp_path).read_bytes()
    cut = tmp_path / "cut.h5"
    for length in np.linspace(1, len(whole) - 1, 12).astype(int):
        cut.write_bytes(whole[:length])
        with pytest.raises(RecordingError) as refusal:
            read_recording(cut)
        assert "\n" not in str(refusal.value)


def test_a_claim_beyond_what_is_stored_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    with h5py.File(path, "r+") as file:
        del file["frames/voltage_v"]
        file["frames"].create_dataset("voltage_v", (10**9, 6, 4), "f4", chunks=(1, 6, 4))
    with pytest.raises(RecordingError, match="voltage_v"):
        read_recording(path)


def test_unknown_fields_are_left_alone(tmp_path: Path) -> None:
    path = written(tmp_path)
    with h5py.File(path, "r+") as file:
        file["truth/segmentation"] = np.zeros((5, 2, 2), np.uint8)
        file["frames/temperature_k"] = np.full(5, 293.0)
    assert_same(example(), read_recording(path))
