"""Readings of four presses on the small sheet, with effects and noise, and the fit of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_skin import FOUR_PRESSES, SMALL, four_presses, small_law, small_sensor

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.nonreciprocal import instruments
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.effect import Effect
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

CHANNELS, NOISE_V = 6, 1e-5
SCAN = replace(
    Protocol.against_sink(electrode_pairs(CHANNELS), CHANNELS, 1e-4), injection_offset_s=np.linspace(0.0, 0.4, 15)
)
CONTACT_OHM = np.linspace(200.0, 900.0, CHANNELS)
START = Calibration(17_000.0, CONTACT_OHM, 0.0, np.zeros(SHAPE))
"""A calibration some way off, as one at rest leaves it."""
PARTITIONS = [[k] for k in range(FOUR_PRESSES)]


def recorded(*effects: Effect) -> VoltageProblem:
    """The fit of readings taken of a skin with the effects; the sheet as calibrated has none."""
    skin = Skin.build(small_sensor(), SCAN, small_law(), CONTACT_OHM, 9000.0, (), SMALL)
    seen = four_presses()
    linear = LinearSkin(skin, seen, np.nan_to_num(skin.force_n(seen)), np.arange(len(seen)), None)
    basis, shape = SCAN.orthonormal, (len(seen), *SCAN.shape)

    def problem(readings: np.ndarray) -> VoltageProblem:
        flat = readings.reshape(len(seen), -1)
        scan = flat @ basis
        evidence = Evidence(
            skin.sensor, SCAN, seen, scan, (flat - scan @ basis.T).reshape(shape).astype(np.float32), NOISE_V, NOISE_V,
            float("nan"), None, np.zeros((scan.shape[1], 0)), np.zeros((*scan.shape, 0)),
            1 - scan.shape[1] / flat.shape[1], np.zeros(CHANNELS, dtype=np.intp),
        )  # fmt: skip
        return VoltageProblem(evidence, SkinFamily(skin, "fast"), linear, None, seen.press, np.ones(len(seen)))

    still = problem(np.zeros(shape))
    assert len(still.acquisition.rows) == len(seen)
    readings = still.acquisition.readings(replace(skin, effects=effects))
    for instrument in instruments(effects):
        readings = instrument.distorted_v(readings, SCAN)
    return problem(readings + NOISE_V * np.random.default_rng(0).standard_normal(shape))
