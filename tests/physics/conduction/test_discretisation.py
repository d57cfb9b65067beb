"""Discretisation error: estimated by refinement, falling at the expected order, as small as the names promise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from sheets import padded_sheet, small_sheet, tank, wavy

from ertskin.physics.conduction.discretisation import discretisation_error
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs

NOISE_V = 2e-3


def pressed(position_m: np.ndarray) -> np.ndarray:
    """18 kohm/sq, four times better under a 10 mm indenter beside an inner pad."""
    distance = np.hypot(*np.moveaxis(position_m - [0.045, 0.043], -1, 0))
    return (1 + 3 / (1 + np.exp((distance - 0.005) / 8e-4))) / 18_000.0


@pytest.fixture(scope="module")
def reference() -> SheetModel:
    return SheetModel(padded_sheet(), "reference")


@pytest.mark.parametrize(
    ("name", "contact_ohm", "reading", "reciprocal"),
    [("fast", 10.0, 0.4, 1.9), ("fast", 1000.0, 0.16, 0.8), ("fine", 10.0, 0.025, 0.12), ("fine", 1000.0, 0.01, 0.05)],
)
def test_named_resolutions(
    reference: SheetModel, name: str, contact_ohm: float, reading: float, reciprocal: float
) -> None:
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    model = SheetModel(padded_sheet(), name)
    error = discretisation_error(model, pressed, np.full(24, contact_ohm), protocol, reference)
    assert error.reading_v < reading * NOISE_V
    assert error.reciprocal_v < reciprocal * NOISE_V


def test_refinement_tells_the_error() -> None:
    sensor, contact = small_sheet(), np.full(5, 40.0)
    protocol = Protocol.against_sink(electrode_pairs(5), 5, 1e-3)
    model = SheetModel(sensor, Resolution(2, Grading(cell_m=3e-3, rim_m=5e-4, growth=3.0)))
    exact = SheetModel(sensor, Resolution(4, Grading(cell_m=2e-3, rim_m=1e-4, growth=3.0)))

    def conductivity(position_m: np.ndarray) -> np.ndarray:
        return wavy(position_m, 1e-3)

    estimate = discretisation_error(model, conductivity, contact, protocol)
    truth = discretisation_error(model, conductivity, contact, protocol, exact)
    assert estimate.reading_v == pytest.approx(truth.reading_v, rel=0.3)
    assert estimate.reciprocal_v == pytest.approx(truth.reciprocal_v, rel=0.3)


@pytest.mark.parametrize(("degree", "order"), [(1, 2.0), (2, 4.0)])
def test_order_on_a_padded_sheet(degree: int, order: float) -> None:
    """Cells smaller than the rim's layer everywhere: the contact is wide, the conductivity smooth."""
    model = SheetModel(small_sheet(), Resolution(degree, Grading(cell_m=3e-3, rim_m=1e-3, growth=1.5)))
    contact, pairs = np.full(5, 4_000.0), []
    for _ in range(3):
        pairs.append(model.solve(wavy(model.quadrature_m, 1e-3), contact).pair_resistance_ohm)
        model = model.refined()
    step = [np.linalg.norm(b - a) for a, b in pairwise(pairs)]
    assert np.log2(step[0] / step[1]) == pytest.approx(order, abs=0.5)


def test_a_tank_with_edge_electrodes_converges() -> None:
    """Robin conditions that jump at the electrodes' ends: grading towards them, the error still falls."""
    sensor, contact = tank(), np.full(16, 0.5)
    protocol = Protocol.against_sink(electrode_pairs(16), 16, 1.0)
    exact = SheetModel(sensor, Resolution(3, Grading(cell_m=0.01, rim_m=1e-4, growth=2.0, spread=0.3)))

    def water(position_m: np.ndarray) -> np.ndarray:
        return wavy(position_m, 1.0, 0.1)

    scale = np.sqrt(
        np.mean(protocol.readings(exact.solve(water(exact.quadrature_m), contact).pair_resistance_ohm) ** 2)
    )
    error = []
    for rim in (4e-3, 2e-3, 1e-3):
        model = SheetModel(sensor, Resolution(2, Grading(cell_m=5 * rim, rim_m=rim, spread=0.4)))
        error.append(discretisation_error(model, water, contact, protocol, exact).reading_v / scale)
    assert error[0] > 1.5 * error[1] > 2.25 * error[2]
    assert error[2] < 2e-4
