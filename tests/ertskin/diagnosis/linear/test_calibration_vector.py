"""What keeps a law positive is linear in the numbers that a fit moves."""

from __future__ import annotations

import numpy as np
from small_skin import small_law

from ertskin.diagnosis.linear.calibration_vector import SHAPE, law_factors, shaped


def test_factors_of_a_law_are_those_of_the_shaped_law() -> None:
    law, change = small_law(), np.random.default_rng(0).normal(scale=0.1, size=SHAPE)
    known, by_shape = law_factors(law)
    pressure_pa = np.linspace(0.0, law.max_stress_pa, len(known))
    for shape in (np.zeros(SHAPE), change):
        expected = shaped(law, shape).scaled(1.0).sheet_resistance_ohm_sq(pressure_pa)
        np.testing.assert_allclose(known + by_shape @ shape, expected, atol=1e-12)
