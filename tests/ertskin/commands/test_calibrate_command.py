"""``ertskin calibrate`` as a person runs it, on whole and on partial recordings."""

import numpy as np
import pytest

from ertskin.calibration import load_calibration
from ertskin.cli import main
from ertskin.hardware.virtual.bench import FAST, write_bench


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A quick recording of a skin with nothing hidden, and its truth."""
    path = tmp_path_factory.mktemp("bench") / "quick.h5"
    return path, write_bench(path, "quick", {}, seed=5, resolution=FAST)


def test_a_bench_gives_back_its_own_numbers(bench, tmp_path, monkeypatch, capsys):
    path, truth = bench
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", f"recording={path}", "out=here", "method=both"]) == 0
    found = load_calibration(tmp_path / "here/calibration.yaml")
    assert found.contact_resistance_ohm == pytest.approx(np.array(truth.contact_ohm), rel=0.02, abs=3.0)
    assert found.indenter_n_per_m == pytest.approx(truth.support_n_per_m, rel=0.02)
    assert found.noise_v == pytest.approx(2e-3, rel=0.1)
    assert "direct search" in capsys.readouterr().out
    page = (tmp_path / "here/report.html").read_text()
    for words in ("Calibration on quick.h5", "ertskin diagnose recording=", "How well the model fits", "commit "):
        assert words in page
    drawn = {figure.stem for figure in (tmp_path / "here").glob("*.png")}
    assert {"force_depth", "specimen", "error_surface", "contact_resistance", "model_error_map"} <= drawn


def test_a_tank_gives_one_contact_resistance_per_electrode_and_the_waters(shared_data, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", f"recording={shared_data / 'real/ktc2023_tank_a.h5'}", "out=tank"]) == 0
    found = load_calibration(tmp_path / "tank/calibration.yaml")
    assert found.contact_resistance_ohm.shape == (32,)
    assert 1000 < found.sensor.sheet_resistance_ohm_sq < 1400
    assert found.law is None


def test_a_coupon_gives_its_modulus(shared_data, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", f"recording={shared_data / 'real/foam_turbo_free_1.h5'}", "out=coupon"]) == 0
    found = load_calibration(tmp_path / "coupon/calibration.yaml")
    assert 3e5 < found.foam_modulus_pa < 7e5
    assert found.sensor is None
    assert "modulus of the foam coupon" in (tmp_path / "coupon/report.html").read_text()


def test_nothing_to_calibrate_on_is_said(shared_data, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", f"recording={shared_data / 'real/eskin_radial.h5'}"]) == 2
    assert "nothing to calibrate on" in capsys.readouterr().err
    assert main(["calibrate", f"recording={shared_data / 'real/foam_turbo_free_1.h5'}", "method=guess"]) == 2
    assert "choose one of gauss_newton" in capsys.readouterr().err


def test_resting_readings_of_no_sheet_are_said_in_a_line(bench, tmp_path, monkeypatch, capsys):
    def never(problem):
        raise RuntimeError("contact resistances did not converge in 40 Gauss-Newton steps")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ertskin.calibration.fit.gauss_newton", never)
    assert main(["calibrate", f"recording={bench[0]}"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("ertskin: contact resistances did not converge in 40 Gauss-Newton steps: the resting")
    assert not any("Traceback" in line for line in said)
