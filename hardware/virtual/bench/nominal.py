"""The sensor and the scan as their maker describes them: what the bench writes into a recording."""

from __future__ import annotations

import numpy as np

from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Layer, Sensor, four_points_m, rectangle_m, taxel_grid_m


def nominal_sensor() -> Sensor:
    """The paper's skin; size and electrode layout are assumed (the paper gives neither)."""
    size_m, pitch_m, first_m = 0.12, 0.022, 0.005
    line = first_m + pitch_m * np.arange(6)
    low, high = np.full(5, line[0]), np.full(5, line[-1])
    around = [
        np.stack([line[:-1], low], axis=1),
        np.stack([high, line[:-1]], axis=1),
        np.stack([line[:0:-1], high], axis=1),
        np.stack([low, line[:0:-1]], axis=1),
    ]
    inner = np.array([[0.04, 0.04], [0.08, 0.04], [0.04, 0.08], [0.08, 0.08]])
    center = np.concatenate([*around, inner])
    fabric = [Layer(name, 4e-4, 344e3, 0.4) for name in ("patch_fabric", "sheet_fabric", "base_fabric")]
    return Sensor(
        outline_m=rectangle_m((size_m, size_m)),
        sheet_resistance_ohm_sq=18e3,
        contact_resistance_guess_ohm=10.0,
        electrode_center_m=center,
        electrode_size_m=np.full((len(center), 2), 4e-3),
        taxel_m=taxel_grid_m((size_m, size_m), 6, 6),
        layers=(Layer("neoprene", 4e-3, 28e3, 0.3), Layer("glue", 2e-4, 1e6, 0.495), *fabric),
        piezo_interface=2,
        indenter_diameter_m=0.01,
        indenter_points_m=four_points_m(0.01),
        pad_margin_m=0.03,
    )


def nominal_protocol(sensor: Sensor) -> Protocol:
    """Every pair of electrodes as source and sink, every electrode read against the sink, one scan in 0.4 s."""
    pairs = electrode_pairs(sensor.electrodes)
    scan_s = 0.4
    return Protocol.against_sink(
        pairs,
        sensor.electrodes,
        1e-4,
        injection_offset_s=scan_s * np.arange(len(pairs)) / len(pairs),
        scan_s=scan_s,
        adc_volts_per_count=10.0 / 65536,
        adc_limit_v=10.0,
    )
