"""The tank study: its own solver against closed forms, and the diagnosis on tanks that solver makes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.diagnosis.any_recording import diagnose_any

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "real" / "ottawa"
MODULES = ("simulated", "photographs", "cases", "nulls")
KNOWN = {"placed": 0.015, "depth": 0.05, "uneven": 0.1, "gain": 1e-3, "noise": 5e-4, "flat": 0.05}


@pytest.fixture(scope="module")
def study():
    """The study's modules, which live outside any package; other studies have files of the same names."""
    sys.path.insert(0, str(STUDY))
    import photographs
    import simulated

    yield simulated, photographs
    sys.path.remove(str(STUDY))
    for name in MODULES:
        sys.modules.pop(name, None)


def point_readings(simulated, angle: np.ndarray) -> np.ndarray:
    """Readings of point electrodes on a disk at these angles: potentials are logarithms of distances."""
    i, j = np.triu_indices(len(angle), 1)
    away = np.abs(2 * np.sin((angle[i] - angle[j]) / 2))
    return simulated.adjacent().readings(2 / np.pi * simulated.SHEET_OHM_SQ * np.log(away / 0.01))


@pytest.mark.parametrize(("squeeze", "within"), [(0.0, 0.003), (0.1, 0.01)])
def test_the_solver_agrees_with_the_disk_and_with_its_conformal_images(study, squeeze: float, within: float):
    simulated, _ = study
    tank = simulated.Tank(squeeze=squeeze, turn=0.7)
    solved = tank.readings(simulated.adjacent())
    angle = simulated.disk_angles(tank.outline, tank.places())
    expected = point_readings(simulated, angle)
    taken = simulated.adjacent().taken
    assert solved[taken] / expected[taken] == pytest.approx(1.0, abs=within)


def test_a_disk_seen_from_beside_its_middle_is_mapped_by_a_moebius_map(study):
    simulated, _ = study
    off = 0.2
    # The circle |z| = 1 about (off, 0): its conformal image is itself, angles are those about its own middle.
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    outline = lambda theta: off * np.cos(theta) + np.sqrt(1 - (off * np.sin(theta)) ** 2)  # noqa: E731
    point = outline(angle) * np.exp(1j * angle)
    # The map keeps the point z = 0, which lies at -off of the unit disk, in the middle.
    unit = point - off
    image = (unit + off) / (1 + off * unit)
    found = simulated.disk_angles(outline, angle)
    assert np.angle(np.exp(1j * (found - np.angle(image)))) == pytest.approx(0.0, abs=1e-3)


def said(tank) -> dict:
    return diagnose_any(tank.recording(), "tank.h5", lambda share, text: None).diagnosis.as_builtins()


def names(found: dict) -> dict[str, float]:
    likely: dict[str, float] = {}
    for claim in found["effects"]:
        likely[claim["name"]] = max(claim["confidence"], likely.get(claim["name"], 0.0))
    return likely


@pytest.mark.parametrize("turn", [0.3, 1.4])
def test_another_squeeze_is_named_and_the_places_found(study, turn: float):
    simulated, _ = study
    tank = simulated.Tank(squeeze=0.12, turn=turn, seed=int(10 * turn), **KNOWN)
    found = said(tank)
    assert list(names(found)) == ["electrode_displacement"]
    assert names(found)["electrode_displacement"] > 0.9
    shift = np.array(found["placement"]["shift_along_rim_m"]) / simulated.RADIUS_M
    assert shift == pytest.approx(tank.disk_shifts(), abs=0.04)


def test_a_round_tank_with_something_inside_is_let_be(study):
    simulated, _ = study
    fault = simulated.Fault(inside=(0.4, -0.2, 0.15), contrast=0.05)
    assert said(simulated.Tank(seed=3, fault=fault, **KNOWN))["effects"] == []


def test_a_squeezed_tank_with_a_faulty_channel_has_both_named(study):
    simulated, _ = study
    found = said(simulated.Tank(squeeze=0.12, turn=0.9, seed=4, fault=simulated.Fault(electrode=9, gain=0.2), **KNOWN))
    assert set(names(found)) == {"electrode_displacement", "channel_gain"}
    assert [c["parameters"]["channel"]["value"] for c in found["effects"] if c["name"] == "channel_gain"] == [9]


def test_a_faulty_channel_alone_moves_no_electrode(study):
    simulated, _ = study
    found = said(simulated.Tank(seed=5, fault=simulated.Fault(electrode=2, gain=-0.5), **KNOWN))
    assert set(names(found)) == {"channel_gain"}


def test_photographed_electrodes_are_expected_where_the_outline_takes_them(study):
    simulated, photographs = study
    tank = simulated.Tank(squeeze=0.15, turn=0.5)
    place = tank.places()
    center = tank.outline(place)[:, None] * np.stack([np.cos(place), np.sin(place)], axis=1)
    assert photographs.expected_shift(center) == pytest.approx(tank.disk_shifts(), abs=0.01)
    assert np.abs(photographs.angles_alone(center) - tank.disk_shifts()).max() > 0.05
