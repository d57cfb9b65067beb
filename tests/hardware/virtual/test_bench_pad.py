"""The bench's pad, foam and pair."""

import numpy as np
import pytest

from ertskin.hardware.virtual.bench.foam import BoucWen, Foam, FoamSpot, Hyperfoam, Mullins, Prony
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.hardware.virtual.bench.pad import FourierPad, PadResolution
from ertskin.hardware.virtual.bench.piezo import ClosingLaw, LogCreep, WedgeMemory
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.sensor import Layer

SENSOR = nominal_sensor()
DEPTH_M = np.concatenate([np.arange(1, 9), np.arange(7, 0, -1)]) * 5e-4


def nominal_pad(resolution: PadResolution | None = None) -> FourierPad:
    return FourierPad(SENSOR.layers, SENSOR.piezo_interface, SENSOR.indenter_points_m, 0.01, resolution)


def test_pressure_carries_the_whole_force():
    distance = np.linspace(0.0, 0.044, 2001)
    pressure = nominal_pad().point_pressure_pa(distance)
    assert np.trapezoid(2 * np.pi * distance * pressure, distance) == pytest.approx(1.0, abs=5e-4)


def test_pressure_at_two_resolutions():
    offset = np.random.default_rng(0).uniform(-0.02, 0.02, (300, 2))
    coarse, fine = nominal_pad().pressure_pa(offset), nominal_pad(PadResolution(11, 0.14, 320, 600)).pressure_pa(offset)
    assert np.abs(coarse - fine).max() < 1e-6 * fine.max()


def test_pressure_agrees_with_the_model_it_is_meant_to_test():
    offset = np.random.default_rng(0).uniform(-0.02, 0.02, (300, 2))
    model = InterfacePressure.from_transform(SENSOR).at(offset)
    assert np.abs(nominal_pad().pressure_pa(offset) - model).max() < 1e-4 * model.max()


def test_a_wide_indenter_on_one_layer_meets_the_confined_modulus():
    layer = Layer("foam", 1e-3, 3e4, 0.3)
    pad = FourierPad([layer], 0, np.zeros((1, 2)), 0.1, PadResolution(8, 0.4, 400, 400))
    confined = layer.youngs_modulus_pa * 0.7 / (1.3 * 0.4)
    assert pad.stiffness_n_per_m == pytest.approx(confined * np.pi * 0.05**2 / 1e-3, rel=0.03)


def forces(foam: Foam, depth_m: np.ndarray = DEPTH_M, seconds: float = 0.5) -> np.ndarray:
    spot = FoamSpot(foam)
    return np.array([spot.press(depth, seconds) for depth in depth_m])


def test_linear_foam_and_support_stand_in_series():
    total = 1 / (1 / 2000.0 + 1 / 9000.0)
    np.testing.assert_allclose(forces(Foam(2000.0, 9000.0)), total * DEPTH_M, rtol=1e-6)


def test_hyperfoam_starts_linear_and_stiffens():
    foam = Hyperfoam(120.0, 2.3)
    assert foam.sinking_equivalent_m(1e-7) == pytest.approx(1e-7, rel=1e-4)
    assert foam.sinking_equivalent_m(3e-3) > 1.2 * 3e-3


def test_prony_relaxes_to_its_long_term_share():
    foam = Foam(2000.0, 1e9, prony=Prony((0.1, 0.1), (1.0, 10.0)))
    held = forces(foam, np.full(4, 2e-3), 40.0)
    fast = forces(foam, np.array([2e-3]), 1e-6)[0]
    assert fast == pytest.approx(4.0, rel=1e-4)
    assert held[-1] == pytest.approx(0.8 * 4.0, rel=1e-3)


def test_loss_does_not_depend_on_the_rate():
    foam = Foam(2000.0, 9000.0, bouc_wen=BoucWen(0.1))
    slow, quick = forces(foam, seconds=5.0), forces(foam, seconds=0.05)
    np.testing.assert_allclose(slow, quick, rtol=1e-12)
    assert (slow[8:] < 0.97 * slow[6::-1]).all()


def test_second_cycle_is_softer_than_the_first():
    cycle = forces(Foam(2000.0, 9000.0, mullins=Mullins(0.15)), np.concatenate([DEPTH_M, DEPTH_M]))
    assert (cycle[15:22] < 0.99 * cycle[:7]).all()


def test_foam_that_lags_behind_lets_go():
    foam = Foam(2000.0, 9000.0, prony=Prony((0.5,), (0.5,)))
    assert forces(foam, np.array([4e-3, 4e-3, 1e-4]), 5.0)[-1] == 0.0


@pytest.mark.parametrize("exponent", [4.1, 4.8])
def test_a_fifth_order_polynomial_can_fit_the_closing_law(exponent: float):
    stress = np.linspace(0.0, 6e4, 300)
    law = ClosingLaw(18e3, 4e3, 6e4, exponent).resistance_ohm(stress)
    fitted = np.polynomial.Polynomial.fit(stress, law, 5)(stress)
    assert np.abs(fitted / law - 1).max() < 4e-4


def test_memory_is_virgin_in_loading_lags_in_unloading_and_closes_at_zero():
    memory = WedgeMemory(0.1)
    state, felt = memory.start(()), []
    course = np.concatenate([np.linspace(0, 3e4, 40), np.linspace(3e4, 0, 40)])
    for pressure in course:
        state, effective = memory.follow(state, np.array(pressure))
        felt.append(float(effective))
    np.testing.assert_allclose(felt[:40], course[:40], atol=1e-8)
    assert felt[60] > 1.05 * course[60]
    assert felt[-1] < 0.02 * 3e4


def test_memory_forgets_an_inner_loop_that_is_wiped_out():
    memory = WedgeMemory(0.1)
    ends = []
    for course in ([2e4, 5e4], [2e4, 1e4, 3e4, 5e4]):
        state = memory.start(())
        for pressure in course:
            state, _ = memory.follow(state, np.array(pressure))
        ends.append(state)
    np.testing.assert_allclose(ends[0], ends[1])


def test_creep_grows_about_as_the_logarithm_of_time():
    creep = LogCreep(0.02)
    factor = [float(creep.factor(creep.dwell(creep.start(()), np.array(1e9), seconds))) for seconds in (1, 10, 100)]
    steps = -np.diff(factor)
    assert steps == pytest.approx([0.02, 0.02], rel=0.25)
