"""A calibration comes back as it was written, and a file that is none gets one line."""

from dataclasses import replace

import numpy as np
import pytest

from ertskin.calibration import Calibration, load_calibration, save_calibration
from ertskin.errors import UserError
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.sensor import Layer, Sensor, rectangle_m, taxel_grid_m


@pytest.fixture
def calibration():
    stress = np.linspace(0, 6e4, 40)
    sensor = Sensor(
        outline_m=rectangle_m((0.1, 0.08)),
        sheet_resistance_ohm_sq=17_500.0,
        electrode_center_m=np.array([[0.01, 0.01], [0.09, 0.01]]),
        electrode_size_m=np.full((2, 2), 4e-3),
        taxel_m=taxel_grid_m((0.1, 0.08), 3, 2),
        layers=(Layer("foam", 4e-3, 3e4, 0.3), Layer("fabric", 4e-4, 3e5, 0.4)),
        piezo_interface=1,
        pad_margin_m=0.03,
    )
    return Calibration(
        recording="bench.h5",
        sensor=sensor,
        law=PiezoPolynomial.fit(stress, 4e3 + 1.4e4 * np.exp(-stress / 1e4)),
        contact_resistance_ohm=np.array([310.25, 12.5]),
        contact_resistance_error_ohm=np.array([0.5, 0.25]),
        indenter_n_per_m=9012.5,
        noise_v=2e-3,
        notes={"hysteresis": 0.047},
    )


def test_comes_back_as_written(calibration, tmp_path):
    save_calibration(tmp_path / "calibration.yaml", calibration)
    found = load_calibration(tmp_path / "calibration.yaml")
    pressure = np.linspace(-1e3, 7e4, 50)
    assert np.array_equal(
        found.law.sheet_resistance_ohm_sq(pressure), calibration.law.sheet_resistance_ohm_sq(pressure)
    )
    assert np.array_equal(found.contact_resistance_ohm, calibration.contact_resistance_ohm)
    assert found.sensor.layers == calibration.sensor.layers
    assert np.array_equal(found.sensor.taxel_m, calibration.sensor.taxel_m)
    assert found.sensor.electrode_edge_m is None
    assert (found.indenter_n_per_m, found.noise_v, found.notes) == (9012.5, 2e-3, {"hysteresis": 0.047})


def test_what_the_recording_could_not_say_stays_unknown(calibration, tmp_path):
    partial = replace(calibration, law=None, contact_resistance_ohm=None, contact_resistance_error_ohm=None)
    save_calibration(tmp_path / "calibration.yaml", partial)
    assert load_calibration(tmp_path / "calibration.yaml").law is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is no calibration"),
        ("format: something-else", "is no calibration"),
        ("format: [", "can't be read as YAML"),
        ("format: ertskin-calibration\nformat_version: 9", "format_version is 9"),
        ("format: ertskin-calibration\nformat_version: 1", "key error at 'law'"),
    ],
)
def test_a_bad_file_gets_one_line(tmp_path, text, said):
    path = tmp_path / "calibration.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=said) as raised:
        load_calibration(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_file_says_how_to_make_one(tmp_path):
    with pytest.raises(UserError, match="ertskin calibrate recording="):
        load_calibration(tmp_path / "nothing.yaml")
