"""Hysteresis, creep and inhomogeneity of the fabric."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ertskin.physics.effects.contact_age import contact_age_s
from ertskin.physics.effects.effect import Start
from ertskin.physics.effects.exponential_memory import lagging
from ertskin.physics.effects.piezo_chain import fabric_ohm_sq
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.piezo.polynomial import PiezoPolynomial

EXTENT = np.array([[0.0, 0.0], [0.12, 0.12]])
NOWHERE = np.zeros((1, 2))


def through(effect, pressure, time_s):
    return effect.effective_pressure_pa(
        np.asarray(pressure, dtype=float)[:, None], NOWHERE, np.asarray(time_s), EXTENT
    )[:, 0]


def test_hysteresis_loads_low_holds_and_unloads_high() -> None:
    up = np.linspace(0, 1e4, 50)
    path = np.concatenate([up, up[::-1]])
    effective = through(PiezoHysteresis(width=0.1), path, np.arange(100.0))
    np.testing.assert_allclose(effective[:50], 0.9 * up, atol=1e-9)
    assert effective[55] == pytest.approx(9e3)
    np.testing.assert_allclose(effective[-30:], 1.1 * path[-30:], atol=1e-9)


def test_hysteresis_does_not_depend_on_the_rate() -> None:
    path = 1e4 * np.abs(np.sin(np.linspace(0, 7, 200)))
    effect = PiezoHysteresis(width=0.2, spread=0.5)
    slow, fast = through(effect, path, np.arange(200.0)), through(effect, path, 0.01 * np.arange(200.0))
    np.testing.assert_array_equal(slow, fast)


@pytest.mark.parametrize("count", [3, 30, 300])
def test_creep_under_constant_pressure_is_exact_for_any_step(count: int) -> None:
    time_s = np.concatenate([[0.0, 1e-9], np.sort(np.random.default_rng(count).uniform(0.1, 40.0, count))])
    pressure = np.concatenate([[0.0], np.full(count + 1, 5e3)])
    effective = through(PiezoCreep(fraction=0.3, time_s=7.0), pressure, time_s)
    expected = 5e3 * (1 + 0.3 * (1 - np.exp(-time_s[2:] / 7.0)))
    np.testing.assert_allclose(effective[2:], expected, rtol=1e-6)


def test_creep_forgets_in_the_air_unless_set_otherwise() -> None:
    pressure, time_s = [0, 1e4, 1e4, 0, 1e4], [0.0, 1e-6, 50.0, 50.1, 50.100001]
    assert through(PiezoCreep(fraction=0.5, time_s=5.0), pressure, time_s)[-1] == pytest.approx(1e4, rel=1e-3)
    assert through(PiezoCreep(fraction=0.5, time_s=5.0, remembers_air=True), pressure, time_s)[-1] > 1.4e4


def test_creep_that_multiplies_loses_its_fraction_of_the_logarithm_of_resistance() -> None:
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 2e4)
    creep = PiezoCreep(fraction=0.3, time_s=7.0, half_pa=5e3, multiplies=True)
    pressure, time_s = np.array([[0.0], [1e4], [1e4]]), np.array([0.0, 1e-9, 7.0])
    uncrept = fabric_ohm_sq(law, (), pressure, NOWHERE, time_s, EXTENT)
    crept = fabric_ohm_sq(law, (creep,), pressure, NOWHERE, time_s, EXTENT)
    contact = 1 - 0.5**2
    np.testing.assert_allclose(np.log(crept / uncrept)[:, 0], [0.0, 0.0, -0.3 * contact * (1 - np.exp(-1))], atol=1e-6)
    np.testing.assert_array_equal(
        crept[[2]], fabric_ohm_sq(law, (creep,), pressure, NOWHERE, time_s, EXTENT, np.array([2]))
    )


@pytest.mark.parametrize(
    ("power", "left"),
    [(1.0, lambda crept: 1 - crept), (-1.0, lambda crept: 1 / (1 + crept)), (0.0, lambda crept: np.exp(-crept))],
)
def test_what_creeps_may_be_a_power_of_resistance_and_gaps_may_be_uneven(power: float, left) -> None:  # type: ignore[no-untyped-def]
    time_s, pressure = np.array([0.0, 1e-6, 7.0]), np.array([[0.0], [1e4], [1e4]])
    creep = PiezoCreep(fraction=0.3, time_s=7.0, half_pa=5e3, unevenness=1.0, power=power, multiplies=True)
    factor = creep.resistance_factor(pressure, NOWHERE, time_s, EXTENT)
    crept = 0.3 * (1e4 / (1e4 + 5e3)) * (1 - np.exp(-1))
    assert factor[-1, 0] == pytest.approx(left(crept), rel=1e-5)
    few = PiezoCreep(fraction=0.3, half_pa=5e3, unevenness=1e-5, power=power, multiplies=True)
    even = PiezoCreep(fraction=0.3, half_pa=5e3, power=power, multiplies=True)
    np.testing.assert_allclose(
        few.resistance_factor(pressure, NOWHERE, time_s, EXTENT),
        even.resistance_factor(pressure, NOWHERE, time_s, EXTENT),
        rtol=1e-5,
    )


def test_long_waits_before_and_after_a_press_are_spent_in_the_air() -> None:
    """Whatever a long step holds beyond the usual half second, it is no creep under a pressure that comes or goes."""
    creep = PiezoCreep(fraction=0.5, time_s=2.0, remembers_air=True)
    time_s = np.concatenate([0.5 * np.arange(5), 2.0 + 8.0 + 0.5 * np.arange(5), [22.0, 22.5]])
    pressure = np.concatenate([np.zeros(5), np.full(5, 1e4), [0.0, 0.0]])
    waited = through(creep, pressure, time_s)
    soon = np.concatenate([0.5 * np.arange(11), [5.5]])
    at_once = through(creep, pressure, soon)
    np.testing.assert_allclose(waited[5:10], at_once[5:10], rtol=1e-9)
    taken_in = 1e4 * 0.5 * (1 - np.exp(-1.0))
    assert at_once[10] == pytest.approx(taken_in, rel=0.15)
    assert waited[10] == pytest.approx(at_once[10] * np.exp(-9.5 / 2.0), rel=1e-9)


def test_between_pressures_a_press_moves_all_the_time() -> None:
    time_s, pressure = np.array([0.0, 0.5, 1.0, 1.5, 9.5]), np.array([1e3, 2e3, 4e3, 6e3, 1e4])
    creep = PiezoCreep(fraction=0.5, time_s=2.0, remembers_air=True)
    fine_s = np.concatenate([time_s[:4], np.linspace(1.5, 9.5, 400)[1:]])
    fine = through(creep, np.interp(fine_s, time_s, pressure), fine_s)
    assert through(creep, pressure, time_s)[-1] == pytest.approx(fine[-1], rel=1e-6)


def test_plays_of_spread_lags_round_the_turn_and_keep_the_loop() -> None:
    up = np.linspace(0, 1e4, 400)
    path = np.concatenate([up, up[::-1]])
    sharp, round_ = (through(PiezoHysteresis(width=0.1, spread=s), path, np.arange(800.0)) for s in (0.0, 0.8))
    held = (np.abs(np.diff(found[400:])) < 1e-9 for found in (sharp, round_))
    first, second = (int(np.argmin(still)) for still in held)
    assert second < 0.6 * first
    loop = [found[600] - found[199] for found in (sharp, round_)]
    assert loop[1] == pytest.approx(loop[0], rel=0.02)


def test_inhomogeneity_is_a_spot_on_a_slope() -> None:
    effect = PiezoInhomogeneity(amplitude=0.4, x_m=0.02, y_m=0.1, radius_m=0.02, gradient_x=0.1)
    at = np.array([[0.02, 0.1], [0.04, 0.1], [0.12, 0.0]])
    slope = 0.1 * (at[:, 0] / 0.12 - 0.5)
    spot = 0.4 * np.exp(-0.5 * np.array([0.0, 1.0, (0.1**2 + 0.1**2) / 0.02**2]))
    np.testing.assert_allclose(effect.logarithm(at, EXTENT), slope + spot, rtol=1e-12)


@pytest.mark.parametrize("part", [0.0, 0.4, 1.0])
def test_a_sensitive_place_answers_a_light_pressure_alike_and_a_heavy_one_by_where_its_field_acts(part: float) -> None:
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 2e4)
    effect = PiezoInhomogeneity(gradient_x=1.0, in_response=part)
    ends, moment = np.array([[0.0, 0.06], [0.12, 0.06]]), np.zeros(1)

    def answered(effects: tuple[PiezoInhomogeneity, ...], pressure_pa: float) -> np.ndarray:
        ohm_sq = fabric_ohm_sq(law, effects, np.full((1, 2), pressure_pa), ends, moment, EXTENT)
        return np.log(ohm_sq[0] / law.zero_ohm_sq)

    np.testing.assert_allclose(answered((effect,), 1.0) / answered((), 1.0), np.exp([-0.5, 0.5]), rtol=1e-3)
    assert answered((effect,), 0.0) == pytest.approx(0.0)
    scaled = law.sheet_resistance_ohm_sq(4e4 * np.exp((1 - part) * np.array([-0.5, 0.5]))) / law.zero_ohm_sq
    np.testing.assert_allclose(answered((effect,), 4e4), np.exp(part * np.array([-0.5, 0.5])) * np.log(scaled))


def test_fields_in_the_response_multiply() -> None:
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 2e4)
    once, twice = (PiezoInhomogeneity(gradient_x=g, in_response=1.0) for g in (0.4, 0.8))
    at, pressure = np.array([[0.12, 0.0]]), np.full((1, 1), 2e4)
    both, alone = (fabric_ohm_sq(law, e, pressure, at, np.zeros(1), EXTENT) for e in ((once, once), (twice,)))
    assert both == pytest.approx(alone)


def test_where_a_field_acts_is_free_once_from_either_end() -> None:
    effect, free = PiezoInhomogeneity(gradient_x=0.4), ("gradient_x", "in_response")
    ends = effect.beginnings(("gradient_x",))
    assert [(end.free, end.effect.value("in_response")) for end in ends] == [(free, 0.0), (free, 1.0)]
    assert ends[1].effect.beginnings(free) == ends
    assert SheetInhomogeneity().beginnings(()) == (Start(SheetInhomogeneity(), ()),)


def test_inhomogeneity_by_nodes_passes_through_them() -> None:
    nodes = ((0.0, 0.1, 0.2), (0.3, 0.4, 0.5), (0.6, 0.7, 0.8))
    at = np.array([[0.0, 0.0], [0.06, 0.06], [0.12, 0.12], [0.12, 0.0]])
    np.testing.assert_allclose(PiezoInhomogeneity(nodes=nodes).logarithm(at, EXTENT), [0.0, 0.4, 0.8, 0.2], atol=1e-12)


def test_a_line_is_a_strip_and_a_step_what_differs_on_its_sides() -> None:
    line = PiezoInhomogeneity(ridge=0.3, step=0.1, angle_rad=np.pi / 2, offset_m=0.01, width_m=0.01, edge_m=5e-4)
    at = np.array([[0.0, 0.07], [0.1, 0.0741], [0.05, 0.085], [0.05, 0.055]])
    found = line.logarithm(at, EXTENT)
    np.testing.assert_allclose(found, [0.3, 0.3 + 0.05, 0.05, -0.05], atol=0.02)
    turned = PiezoInhomogeneity(ridge=0.3, angle_rad=np.pi / 4, width_m=0.01)
    along = 0.06 + np.outer([-0.03, 0.0, 0.03], [1.0, -1.0])
    np.testing.assert_allclose(turned.logarithm(along, EXTENT), 0.3, rtol=1e-9)


def test_a_raised_field_is_the_same_and_more_everywhere() -> None:
    at = np.random.default_rng(0).uniform(0, 0.12, (20, 2))
    for effect in (PiezoInhomogeneity(amplitude=0.4, x_m=0.02), PiezoInhomogeneity(nodes=((0.0, 0.1), (0.3, 0.4)))):
        more = effect.raised(0.25).logarithm(at, EXTENT) - effect.logarithm(at, EXTENT)
        np.testing.assert_allclose(more, 0.25, rtol=1e-9)


def test_a_lag_is_felt_along_the_way_and_some_of_it_stays() -> None:
    lag, way = 0.3, 5e3
    pressure = np.array([0.0, 2e3, 8e3, 2e3, 0.0, 0.0, 4e3])[:, None]
    felt = PiezoHysteresis(lag=lag, way_pa=way).effective_pressure_pa(
        pressure, np.zeros((1, 2)), np.arange(7.0), np.zeros((2, 2))
    )[:, 0]
    behind = lag * way * -np.expm1(-pressure[:3, 0] / way)
    np.testing.assert_allclose(felt[:3], pressure[:3, 0] - behind)
    # On the way back it lies ahead: e = -lag way + (e0 + lag way) exp(-way back).
    left = -lag * way + (behind[2] + lag * way) * np.exp(-8e3 / way)
    np.testing.assert_allclose(felt[4:6], -left)
    assert felt[4] > 0
    np.testing.assert_allclose(felt[6], 4e3 - (lag * way + (left - lag * way) * np.exp(-4e3 / way)))


def test_what_lags_remembers_the_air() -> None:
    assert PiezoHysteresis(lag=0.1).remembers_air
    assert not PiezoHysteresis(width=0.1).remembers_air


def test_contacts_age_while_nothing_changes_and_are_renewed_by_a_relative_change() -> None:
    time_s = np.array([0.0, 1.0, 11.0, 12.0, 13.0, 14.0])
    pressure = np.array([0.0, 1e4, 1e4, 1e4 * np.e**2, 0.0, 1e4])[:, None]
    age_s = contact_age_s(pressure, time_s, slip=1.0)[:, 0]
    renewed = np.exp(-2.0) * 10.0 + (1 - np.exp(-2.0)) / 2.0
    np.testing.assert_allclose(age_s, [0.0, 0.0, 10.0, renewed, 0.0, 0.0])


def test_contact_age_is_that_of_the_equation() -> None:
    time_s = np.linspace(0.0, 20.0, 9)
    log_pressure = np.array([0.0, 1.0, 1.5, 1.5, 1.2, 2.0, 2.0, 0.5, 0.0])

    def aged(time: float, age: np.ndarray) -> np.ndarray:
        step = min(int(np.searchsorted(time_s, time, side="right")), len(time_s) - 1)
        rate = (log_pressure[step] - log_pressure[step - 1]) / (time_s[step] - time_s[step - 1])
        return 1.0 - age * abs(rate) / 0.7

    expected = solve_ivp(aged, (0.0, 20.0), [0.0], t_eval=time_s, max_step=0.02, rtol=1e-8).y[0]
    np.testing.assert_allclose(
        contact_age_s(np.exp(log_pressure)[:, None], time_s, slip=0.7)[:, 0], expected, rtol=1e-4
    )


def test_contacts_that_age_conduct_better_with_the_logarithm_of_time() -> None:
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 2e4)
    creep = PiezoCreep(fraction=0.3, time_s=2.0, half_pa=5e3, multiplies=True, ages=True)
    pressure, time_s = np.array([[0.0], [1e4], [1e4], [1e4]]), np.array([0.0, 1.0, 11.0, 101.0])
    uncrept = fabric_ohm_sq(law, (), pressure, NOWHERE, time_s, EXTENT)
    crept = fabric_ohm_sq(law, (creep,), pressure, NOWHERE, time_s, EXTENT)
    np.testing.assert_allclose(np.log(uncrept / crept)[:, 0], 0.3 * 0.75 * np.log1p(np.array([0, 0, 10, 100]) / 2.0))


@pytest.mark.parametrize(
    ("settings", "wrong"), [({}, "multiplies"), ({"multiplies": True, "remembers_air": True}, "remembers_air")]
)
def test_contacts_that_age_must_multiply_and_forget_in_air(settings: dict[str, bool], wrong: str) -> None:
    with pytest.raises(ValueError, match=wrong):
        PiezoCreep(ages=True, **settings)


def test_a_hardly_changing_pressure_lets_contacts_age() -> None:
    pressure = 1e4 * (1 + 2e-16 * np.arange(6))[:, None]
    assert contact_age_s(pressure, np.arange(6.0), slip=50.0)[-1, 0] == pytest.approx(5.0)


def test_several_time_constants_take_in_the_mean_of_each() -> None:
    rng = np.random.default_rng(0)
    time_s, drive = np.cumsum(rng.uniform(0.1, 3.0, 40)), rng.uniform(0.0, 1.0, (40, 2))
    constants_s = np.array([0.2, 3.0, 50.0])
    each = [lagging(drive, time_s, constants_s[k : k + 1], moves_s=0.5) for k in range(3)]
    np.testing.assert_allclose(lagging(drive, time_s, constants_s, moves_s=0.5), np.mean(each, axis=0), atol=1e-12)


@pytest.mark.parametrize(
    ("creep", "shape"),
    [
        (PiezoCreep(fraction=0.3, time_s=5.0, decades=2.0, remembers_air=True, multiplies=True), "half_pa"),
        (PiezoCreep(fraction=0.3, time_s=5.0, exponent=0.5), "exponent"),
    ],
    ids=["a factor", "a power of the pressure"],
)
def test_without_its_lag_creep_is_a_law_of_the_pressure_alone(creep: PiezoCreep, shape: str) -> None:
    static = creep.at_once(("fraction", "time_s", "decades"))
    assert static is not None
    assert static.free == ("fraction", shape)
    path = np.concatenate([np.linspace(1e3, 2e4, 20), np.linspace(2e4, 1e3, 20)])
    law = PiezoPolynomial(np.array([0.6, -0.4]), 6e4, 2e4)

    def loop(effect) -> float:
        resistance = fabric_ohm_sq(law, (effect,), path[:, None], NOWHERE, 10.0 * np.arange(40.0), EXTENT)[:, 0]
        return float(np.abs(np.log(resistance[21:-1] / resistance[1:19][::-1])).max())

    assert loop(static.effect) < 0.02 * loop(creep)


def test_creep_in_proportion_leaves_no_law_of_its_own() -> None:
    assert PiezoCreep(fraction=0.3).at_once(("fraction", "time_s")) is None
