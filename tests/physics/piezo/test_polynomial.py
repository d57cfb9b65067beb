"""The piezoresistive law: monotone, held outside its range, and fitted through noise that grows with the value."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.piezo.polynomial import ORDER, PiezoPolynomial

LARGEST = 6e4


def true_law(stress: np.ndarray) -> np.ndarray:
    x = stress / LARGEST
    return 18000 * (1 - 0.8 * (1 - (1 - x) ** 5))


@pytest.fixture(scope="module")
def specimen() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    stress = np.tile(np.concatenate([np.arange(0, 61), np.arange(59, -1, -1)]) * 1e3, 5)
    return stress, true_law(stress) * (1 + 0.003 * rng.standard_normal(stress.size))


def test_recovers_a_fifth_order_law_to_its_noise(specimen: tuple[np.ndarray, np.ndarray]):
    law = PiezoPolynomial.fit(*specimen)
    at = np.linspace(0, LARGEST, 101)
    assert law.sheet_resistance_ohm_sq(at) == pytest.approx(true_law(at), rel=2e-3)
    assert law.zero_ohm_sq == pytest.approx(18000, rel=2e-3)


def test_never_rises_even_where_the_data_do():
    rng = np.random.default_rng(5)
    stress = np.linspace(0, LARGEST, 200)
    bumpy = 18000 / (1 + stress / 2e3) * (1 + 0.1 * rng.standard_normal(200))
    law = PiezoPolynomial.fit(stress, bumpy)
    at = np.linspace(-1e4, 1.5 * LARGEST, 4001)
    assert np.diff(law.sheet_resistance_ohm_sq(at)).max() <= 1e-6
    assert law.derivative(at).max() <= 1e-9


def test_monotone_fit_is_the_constrained_optimum():
    """Against a general solver on the same cost and constraints."""
    from scipy.optimize import minimize

    stress = np.linspace(0, 1.0, 60)
    value = 1.0 + np.where(stress < 0.3, 0.0, -1.0) * (stress - 0.3) * 0.8
    law = PiezoPolynomial.fit(stress, value)
    weight = 1 / law.sheet_resistance_ohm_sq(stress)
    powers = stress[:, None] ** np.arange(ORDER + 1)
    grid = np.linspace(0, 1, 400)
    slope = np.arange(1, ORDER + 1) * grid[:, None] ** np.arange(ORDER)

    def cost(c: np.ndarray) -> float:
        return float((((powers @ c - value) * weight) ** 2).sum())

    found = minimize(
        cost,
        np.array([1.0, -0.5, 0, 0, 0, 0]),
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda c: -slope @ c[1:]},
        options={"maxiter": 500, "ftol": 1e-14},
    )
    ours = float((((law.sheet_resistance_ohm_sq(stress) - value) * weight) ** 2).sum())
    assert ours == pytest.approx(found.fun, rel=1e-3)


def test_held_constant_outside_the_specimens_range(specimen: tuple[np.ndarray, np.ndarray]):
    law = PiezoPolynomial.fit(*specimen)
    ends = law.sheet_resistance_ohm_sq(np.array([0.0, LARGEST]))
    assert law.sheet_resistance_ohm_sq(np.array([-5e4, 2 * LARGEST])) == pytest.approx(ends)
    assert np.all(law.derivative(np.array([-1.0, LARGEST + 1])) == 0)


def test_derivative_is_the_difference_quotient(specimen: tuple[np.ndarray, np.ndarray]):
    law = PiezoPolynomial.fit(*specimen)
    at = np.linspace(1e3, LARGEST - 1e3, 40)
    quotient = (law.sheet_resistance_ohm_sq(at + 1) - law.sheet_resistance_ohm_sq(at - 1)) / 2
    assert law.derivative(at) == pytest.approx(quotient, rel=1e-6)


def test_scaled_keeps_the_shape(specimen: tuple[np.ndarray, np.ndarray]):
    law = PiezoPolynomial.fit(*specimen)
    at = np.linspace(0, LARGEST, 11)
    ratio = law.scaled(20000.0).sheet_resistance_ohm_sq(at) / law.sheet_resistance_ohm_sq(at)
    assert ratio == pytest.approx(20000.0 / law.zero_ohm_sq)


def test_noise_is_weighted_as_a_fraction_of_the_value():
    """The standard error at the saturated end is that of relative weights; a plain fit's is far larger."""
    at = np.array([LARGEST])
    stress = np.tile(np.arange(0, 61) * 1e3, 4)
    ends = [
        PiezoPolynomial.fit(
            stress, true_law(stress) * (1 + 0.02 * np.random.default_rng(seed).standard_normal(stress.size))
        ).sheet_resistance_ohm_sq(at)[0]
        for seed in range(60)
    ]
    assert np.std(ends) / true_law(at)[0] < 0.01


def test_too_few_stresses_are_refused():
    with pytest.raises(ValueError, match="more than 5"):
        PiezoPolynomial.fit(np.tile([0.0, 1e4, 2e4], 10), np.full(30, 1e4))
