"""A small sheet with six pads, its law, and a mesh coarse enough for both to be quick."""

from __future__ import annotations

import numpy as np

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution
from ertskin.physics.history import History, Phase
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Layer, Sensor, rectangle_m

SMALL = Resolution(2, Grading(cell_m=6e-3, rim_m=2e-3, growth=2.0))
CENTERS = np.array([[0.006, 0.006], [0.054, 0.006], [0.054, 0.054], [0.006, 0.054], [0.03, 0.006], [0.03, 0.054]])
TAXELS = np.array([[0.015, 0.03], [0.03, 0.03], [0.045, 0.03], [0.03, 0.045]])


def small_sensor() -> Sensor:
    """60 mm by 60 mm, four taxels around the middle."""
    return Sensor(
        outline_m=rectangle_m((0.06, 0.06)),
        sheet_resistance_ohm_sq=18_000.0,
        electrode_center_m=CENTERS,
        electrode_size_m=np.full((6, 2), 4e-3),
        layers=(Layer("foam", 4e-3, 3e4, 0.3), Layer("fabric", 4e-4, 3e5, 0.4), Layer("sheet", 4e-4, 3e5, 0.4)),
        piezo_interface=1,
        pad_margin_m=0.03,
        taxel_m=TAXELS,
    )


def small_law() -> PiezoPolynomial:
    """From 18 kohm per square at rest to 4 under pressure."""
    stress = np.linspace(0, 6e4, 40)
    return PiezoPolynomial.fit(stress, 4e3 + 1.4e4 * np.exp(-stress / 1e4))


FOUR_PRESSES = 4


def four_presses() -> History:
    """Presses at four places, each to 2 mm and back after a frame at rest."""
    depth_m = np.array([np.nan, 1e-3, 2e-3, 1e-3] * FOUR_PRESSES)
    phase = np.array([Phase.REST, Phase.LOADING, Phase.LOADING, Phase.UNLOADING] * FOUR_PRESSES, dtype=np.uint8)
    press = np.repeat(np.arange(FOUR_PRESSES), 4)
    place = np.array([[0.012, 0.01], [0.03, 0.04], [0.04, 0.015], [0.015, 0.035]])[press]
    contact_m = np.where(np.isfinite(depth_m)[:, None], place, np.nan)[:, None]
    return History(5.0 * np.arange(16), press, phase, contact_m, depth_m[:, None], np.full((16, 1), np.nan))


def two_presses() -> History:
    """Two presses to 2 mm and back, frames at rest about them."""
    depth_m = np.array([np.nan, 1e-3, 2e-3, 1e-3] * 2 + [np.nan])
    phase = [Phase.REST, Phase.LOADING, Phase.LOADING, Phase.UNLOADING] * 2 + [Phase.REST]
    press = np.repeat([0, 1, 2], [4, 4, 1])
    place = np.array([[0.012, 0.01], [0.03, 0.04], [np.nan, np.nan]])[press]
    contact_m = np.where(np.isfinite(depth_m)[:, None], place, np.nan)[:, None]
    nowhere = np.full((len(press), 1), np.nan)
    return History(5.0 * np.arange(9), press, np.array(phase, dtype=np.uint8), contact_m, depth_m[:, None], nowhere)


def undriven() -> Protocol:
    """Every pair drives, neighbours are read, none of them at a driven electrode."""
    driving = np.stack(np.triu_indices(len(CENTERS), 1), axis=1)
    reading = np.stack([np.arange(len(CENTERS)), np.roll(np.arange(len(CENTERS)), -1)], axis=1)
    current_a = np.eye(len(CENTERS))[driving[:, 0]] - np.eye(len(CENTERS))[driving[:, 1]]
    apart = ~(driving[:, None, :, None] == reading[None, :, None, :]).any(axis=(2, 3))
    scan = Protocol.differences(1e-3 * current_a, reading)
    return Protocol(scan.injection_current_a, scan.measurement, measured=apart)
