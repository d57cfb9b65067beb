"""The paper's pad (Table I) as a sensor."""

from __future__ import annotations

import pytest

from ertskin.physics.sensor import Layer, Sensor, rectangle_m


@pytest.fixture(scope="session")
def paper_sensor() -> Sensor:
    layers = (
        Layer("neoprene", 4e-3, 28e3, 0.3),
        Layer("glue", 2e-4, 1e6, 0.495),
        Layer("patch_fabric", 4e-4, 344e3, 0.4),
        Layer("sheet_fabric", 4e-4, 344e3, 0.4),
        Layer("base_fabric", 4e-4, 344e3, 0.4),
    )
    return Sensor(rectangle_m((0.12, 0.12)), layers=layers, piezo_interface=2, pad_margin_m=0.03)
