"""Other people's files become recordings: the same readings from every format, and one line where they can't."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from ertskin.cli import main
from ertskin.errors import UserError
from ertskin.hardware.recording import read_recording
from ertskin.importing.mapping import recording_of
from ertskin.importing.template import BODY, write_template
from ertskin.importing.variables import described, read_variables
from ertskin.physics.history import Phase

sys.path.insert(0, str(Path(__file__).parent))
from tank import CURRENT_A, FRAMES, SCAN, SENSOR, fwd_model, rotated, tank_readings, write_mat, write_mat73

MAPPING: dict[str, Any] = {
    "rig": "tank",
    "sensor": SENSOR,
    "protocol": SCAN,
    "frames": {"voltage_v": {"from": "V"}, "time_s": {"step": 0.05}, "rest": 20},
}


@pytest.fixture(scope="module")
def readings() -> np.ndarray:
    return tank_readings()


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Any]:
    """The recording a mapping makes of a file."""

    def make(file: Path, mapping: dict[str, Any]) -> Any:
        path = tmp_path / "mapping.yaml"
        path.write_text(yaml.safe_dump(mapping))
        return recording_of(file, path)

    return make


def with_frames(**frames: Any) -> dict[str, Any]:
    return MAPPING | {"frames": MAPPING["frames"] | frames}


def npz(path: Path, readings: np.ndarray) -> Path:
    np.savez(path / "tank.npz", V=readings)
    return path / "tank.npz"


def mat(path: Path, readings: np.ndarray) -> Path:
    write_mat(path / "tank.mat", {"V": readings.T})
    return path / "tank.mat"


def mat73(path: Path, readings: np.ndarray) -> Path:
    write_mat73(path / "tank.mat", {"V": readings.T})
    return path / "tank.mat"


def csv(path: Path, readings: np.ndarray) -> Path:
    names = ",".join(["t", *(f"v_{k}" for k in range(208))])
    table = np.column_stack([0.05 * np.arange(FRAMES), readings])
    np.savetxt(path / "tank.csv", table, delimiter=",", header=names, comments="")
    return path / "tank.csv"


@pytest.mark.parametrize(
    ("kept", "voltage"), [(npz, "V"), (mat, "V"), (mat73, "V"), (csv, "v_*")], ids=["npz", "mat", "mat73", "csv"]
)
def test_every_format_gives_the_same_frames(
    kept: Callable[[Path, np.ndarray], Path],
    voltage: str,
    readings: np.ndarray,
    tmp_path: Path,
    made: Callable[..., Any],
) -> None:
    recording = made(kept(tmp_path, readings), with_frames(voltage_v={"from": voltage}))
    frames, protocol = recording.frames, recording.protocol
    assert frames.voltage_v.shape == (FRAMES, 16, 16)
    assert np.isnan(frames.voltage_v[:, ~protocol.taken]).all()
    np.testing.assert_allclose(frames.voltage_v[:, protocol.taken], readings, atol=1e-7)
    assert protocol.taken.sum() == 208
    assert (frames.history.phase == Phase.REST).sum() == 20
    assert recording.sensor.electrodes == 16


def test_rotating_readings_are_put_in_their_place(
    readings: np.ndarray, tmp_path: Path, made: Callable[..., Any]
) -> None:
    recording = made(npz(tmp_path, rotated(readings)), with_frames(order="rotating"))
    np.testing.assert_allclose(recording.frames.voltage_v[:, recording.protocol.taken], readings, atol=1e-7)


@pytest.mark.parametrize("write", [write_mat, write_mat73])
def test_an_eidors_structure(
    write: Callable[..., None], readings: np.ndarray, tmp_path: Path, made: Callable[..., Any]
) -> None:
    write(tmp_path / "eidors.mat", {"fmdl": fwd_model(), "data": {"meas": readings.T}})
    recording = made(
        tmp_path / "eidors.mat",
        {
            "eidors": {"fwd_model": "fmdl", "metres_per_unit": 0.14},
            "sensor": {"sheet_resistance_ohm_sq": 500.0},
            "frames": {"voltage_v": {"from": "data.meas"}, "time_s": {"step": 0.05}, "rest": FRAMES},
        },
    )
    assert recording.sensor.electrode_edge_m.shape == (16, 2, 2)
    first, last = recording.sensor.electrode_edge_m[4]
    assert np.allclose(first, 0.14 * np.array([np.sin(2 * np.pi / 64), np.cos(2 * np.pi / 64)]))
    assert last[0] == pytest.approx(-first[0])  # counter-clockwise, over the top
    assert recording.protocol.shape == (16, 13)
    assert recording.protocol.pairs[15].tolist() == [15, 0]
    assert recording.protocol.injection_current_a.max() == CURRENT_A
    assert recording.frames.voltage_v.shape == (FRAMES, 16, 13)
    np.testing.assert_allclose(recording.frames.voltage_v.reshape(FRAMES, -1), readings, atol=1e-7)


def test_presses_in_millimetres_from_columns(tmp_path: Path, made: Callable[..., Any]) -> None:
    count = 8
    pressed = np.array([0, 1, 1, 0, 1, 1, 1, 0], dtype=bool)
    place = np.where(pressed, [np.nan, 20, 20, np.nan, 20, 20, 40, np.nan], np.nan)
    np.savez(tmp_path / "skin.npz", v=np.zeros((count, 208)), x=place, y=place / 2, f=np.where(pressed, 2000.0, 0.0))
    recording = made(
        tmp_path / "skin.npz",
        with_frames(
            voltage_v={"from": "v"},
            contact_m={"from": ["x", "y"], "scale": 1e-3},
            force_n={"from": "f", "scale": 1e-3, "offset": 0.5},
            rest={"from": "f", "offset": -2000.0},
        )
        | {"specimen": {"stress_pa": [0, 1e3], "sheet_resistance_ohm_sq": [2e4, 1e4], "time_s": {"step": 1}}},
    )
    history = recording.frames.history
    assert history.contact_m[1, 0].tolist() == pytest.approx([0.02, 0.01])
    assert history.force_n[:, 0].tolist() == [0.5, 2.5, 2.5, 0.5, 2.5, 2.5, 2.5, 0.5]
    assert recording.specimen.cycle.tolist() == [0, 0]
    no_flags = made(
        tmp_path / "skin.npz",
        with_frames(voltage_v={"from": "v"}, contact_m={"from": ["x", "y"], "scale": 1e-3}, rest=None),
    )
    assert (no_flags.frames.history.phase == Phase.REST).tolist() == (~pressed).tolist()
    assert no_flags.frames.history.press.tolist() == [0, 0, 0, 1, 1, 1, 2, 3]


BAD = {
    "no variable": (with_frames(voltage_v={"from": "U"}), "frames.voltage_v: tank.npz has no 'U'; it has V"),
    "unknown part": (MAPPING | {"frame": {}}, "unknown part frame; there are rig, comment"),
    "unknown field": (with_frames(voltages={"from": "V"}), "frames: unknown voltages"),
    "no current": (MAPPING | {"protocol": {"injection": "adjacent"}}, "protocol: KeyError: 'current_a'"),
    "another scan": (MAPPING | {"protocol": SCAN | {"measured": "all"}}, "expected one axis of 256 readings"),
    "no protocol": ({k: v for k, v in MAPPING.items() if k != "protocol"}, "protocol: missing"),
    "no time": (with_frames(time_s=None), "frames.time_s: missing"),
    "a part that is a word": (MAPPING | {"sensor": "round"}, "sensor: found 'round'"),
    "too wide electrodes": (
        MAPPING | {"sensor": SENSOR | {"edge_electrodes": {"count": 16, "width_m": 0.1}}},
        "16 electrodes of 0.1 m don't fit on an outline of 0.879",
    ),
    "wrong order": (with_frames(order="backwards"), "found 'backwards', expected fixed or rotating"),
    "wrong axes": (with_frames(voltage_v={"from": "V", "axes": [0]}), "don't order the 2 axes"),
    "wrong length": (with_frames(time_s=[0.0, 1.0]), "frames.time_s: found 2 values, expected 24"),
    "no model": (MAPPING | {"eidors": {"fwd_model": "imdl"}}, "eidors.fwd_model: tank.npz has no 'imdl'"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_wrong_mapping_is_refused_in_one_line(
    name: str, readings: np.ndarray, tmp_path: Path, made: Callable[..., Any]
) -> None:
    mapping, reason = BAD[name]
    with pytest.raises(UserError, match=r"mapping\.yaml: ") as raised:
        made(npz(tmp_path, readings), mapping)
    assert reason in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("x.npz", b"PK garbage", "can't be read as NPZ"),
        ("x.mat", b"garbage", "can't be read as MAT"),
        ("x.csv", b"a,b\n1,2,3\n", "columns"),
        ("x.csv", b"", "holds no line"),
        ("x.xls", b"", "can't import '.xls' files"),
        ("x.npz", None, "no such file to import"),
    ],
)
def test_a_file_that_can_not_be_read(tmp_path: Path, name: str, content: bytes | None, reason: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UserError, match=reason):
        read_variables(path)


def test_the_template_says_what_the_file_holds(readings: np.ndarray, tmp_path: Path) -> None:
    write_mat(tmp_path / "tank.mat", {"V": readings.T, "fmdl": fwd_model()})
    lines = described(read_variables(tmp_path / "tank.mat"))
    assert "V: 208 x 24, float64" in lines
    assert "fmdl.electrode: 16 structures with nodes, z_contact" in lines
    write_template(tmp_path / "import.yaml", tmp_path / "tank.mat")
    text = (tmp_path / "import.yaml").read_text()
    assert "#   V: 208 x 24, float64\n" in text
    assert set(yaml.safe_load(BODY)) == {"rig", "sensor", "protocol", "frames"}
    with pytest.raises(UserError, match="is there already and was left alone"):
        write_template(tmp_path / "import.yaml", None)


def test_the_template_itself_imports_a_sheet(readings: np.ndarray, tmp_path: Path, monkeypatch, capsys) -> None:
    """As it is written, but for the resistance: far off, it is refused as an error of units."""
    monkeypatch.chdir(tmp_path)
    mat73(tmp_path, readings)
    assert main(["import", "--template", "source=tank.mat"]) == 0
    assert main(["import", "source=tank.mat", "mapping=import.yaml", "out=tank.h5"]) == 2
    assert "looks like another unit" in capsys.readouterr().err
    Path("import.yaml").write_text(Path("import.yaml").read_text().replace("18.0e+3", "500.0"))
    assert main(["import", "source=tank.mat", "mapping=import.yaml", "out=tank.h5"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("tank.h5\n")
    assert "ertskin calibrate recording=tank.h5" in said
    assert read_recording("tank.h5").frames.voltage_v.shape == (FRAMES, 16, 16)
    assert main(["import", "source=tank.mat", "out=tank.h5"]) == 2
    assert "is there already and was left alone" in capsys.readouterr().err
    assert [path.name for path in tmp_path.glob("*.h5")] == ["tank.h5"]


def test_what_makes_no_sound_recording_leaves_nothing(
    readings: np.ndarray, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    npz(tmp_path, np.where(np.arange(208) == 3, np.inf, readings))
    Path("import.yaml").write_text(yaml.safe_dump(MAPPING))
    assert main(["import", "source=tank.npz"]) == 2
    error = capsys.readouterr().err
    assert "import.yaml makes no sound recording of tank.npz: /frames/voltage_v: found" in error
    assert not list(tmp_path.glob("*.h5"))


def test_without_a_source_it_says_what_to_do(capsys) -> None:
    assert main(["import"]) == 2
    assert "source=FILE" in capsys.readouterr().err
    assert importlib.import_module("ertskin.commands.import").reworded(["--template=a.yaml"]) == ["template=a.yaml"]
