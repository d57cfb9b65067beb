"""A small skin whose sheet solves in milliseconds."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Layer, Sensor, rectangle_m

LAYERS = (
    Layer("neoprene", 4e-3, 28e3, 0.3),
    Layer("glue", 2e-4, 1e6, 0.495),
    Layer("patch_fabric", 4e-4, 344e3, 0.4),
    Layer("sheet_fabric", 4e-4, 344e3, 0.4),
    Layer("base_fabric", 4e-4, 344e3, 0.4),
)


@pytest.fixture(scope="session")
def skin() -> Sensor:
    centers = 1e-3 * np.array([[8, 8], [30, 8], [52, 8], [52, 30], [52, 52], [30, 52], [8, 52], [8, 30]], dtype=float)
    return Sensor(
        rectangle_m((0.06, 0.06)),
        sheet_resistance_ohm_sq=18000.0,
        contact_resistance_guess_ohm=10.0,
        electrode_center_m=centers,
        electrode_size_m=np.full((8, 2), 4e-3),
        layers=LAYERS,
        piezo_interface=2,
        pad_margin_m=0.03,
    )


@pytest.fixture(scope="session")
def sheet(skin: Sensor) -> SheetModel:
    return SheetModel(skin, "fast")


@pytest.fixture(scope="session")
def protocol() -> Protocol:
    return Protocol.against_sink(electrode_pairs(8), 8, 1e-4)
