"""The pad's force with foam effects, its support in series."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf, exp1

from ertskin.physics.effects.effect import Strokes
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam
from ertskin.physics.history import History
from ertskin.physics.mechanics.reaction import foam_force_n

PAD, SUPPORT, FOAM_M = 1800.0, 9000.0, 0.004


def presses(count: int, hold_s: float = 20.0, places: int = 1) -> History:
    """Presses that load to 4 mm in eight steps, hold, and unload, each after a rest."""
    depth, time_s, phase, press, contact = [], [], [], [], []
    now = 0.0
    for k in range(count):
        rows = [(np.nan, 0, 10.0)] + [(0.5e-3 * s, 1, 0.5) for s in range(1, 9)] + [(4e-3, 2, hold_s)]
        rows += [(0.5e-3 * s, 3, 0.5) for s in range(7, 0, -1)]
        for d, p, wait in rows:
            now += wait
            depth.append(d)
            time_s.append(now)
            phase.append(p)
            press.append(k)
            contact.append((0.02 * (k % places), 0.02))
    empty = np.full((len(depth), 1), np.nan)
    return History(
        np.array(time_s),
        np.array(press),
        np.array(phase, dtype=np.uint8),
        np.array(contact)[:, None],
        np.array(depth)[:, None],
        empty,
    )


def test_elastic_pad_and_support_are_springs_in_series() -> None:
    history = presses(1)
    force = foam_force_n(history, PAD, SUPPORT, FOAM_M)[:, 0]
    expected = np.nan_to_num(history.depth_m[:, 0]) / (1 / PAD + 1 / SUPPORT)
    np.testing.assert_allclose(force, expected, rtol=1e-12)


def test_stiffening_solves_the_series_exactly() -> None:
    history = presses(1)
    force = foam_force_n(history, PAD, SUPPORT, FOAM_M, [NonlinearFoam(stiffening=0.7)])[:, 0]
    touched = history.touched[:, 0]
    sink = history.depth_m[touched, 0] - force[touched] / SUPPORT
    np.testing.assert_allclose(force[touched], PAD * sink * (1 + 0.7 * (sink / FOAM_M) ** 2), rtol=1e-5)


SOFT_SUPPORT = 2500.0
LOSSES = [
    FoamHysteresis(loss=0.2),
    FoamHysteresis(loss=0.2, reversal=0.02),
    FoamSoftening(excess=0.5, scale=0.05, driven_by="energy", kept=0.2),
    FoamSoftening(excess=0.5, scale=0.2, driven_by="work"),
]


@pytest.mark.parametrize("effect", LOSSES, ids=str)
def test_what_is_lost_on_the_way_is_in_balance_with_the_support(effect: FoamHysteresis | FoamSoftening) -> None:
    history = presses(3)
    force = foam_force_n(history, PAD, SOFT_SUPPORT, FOAM_M, [effect])[:, 0]
    touched = history.touched[:, 0]
    sink = np.where(touched, np.nan_to_num(history.depth_m[:, 0]) - force / SOFT_SUPPORT, 0.0)
    assert sink.min() >= 0
    strokes = Strokes(sink, PAD * sink, history.time_s, touched, history.spot[:, 0], history.press, FOAM_M)
    np.testing.assert_allclose(effect.reaction_n(PAD * sink, strokes)[touched], force[touched], atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_no_foam_presses_harder_than_its_support_can_bear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    history = presses(3)
    depth_m = np.where(history.touched, rng.uniform(0.0, 4e-3, history.depth_m.shape), np.nan)
    foam = [NonlinearFoam(stiffening=0.1), FoamHysteresis(loss=0.418, reversal=0.02)]
    force = foam_force_n(history, 7000.0, 4900.0, FOAM_M, foam, depth_m)
    assert (force[history.touched] <= 4900.0 * depth_m[history.touched] + 1e-9).all()
    assert np.nanmin(force) >= 0.0


@pytest.mark.parametrize("seed", range(6))
def test_two_effects_of_foam_come_to_rest_to_a_millinewton(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    every = [
        ViscoelasticFoam(fraction=rng.uniform(0.0, 0.3), time_s=rng.uniform(0.5, 20.0)),
        FoamHysteresis(loss=rng.uniform(0.0, 0.3)),
        FoamSoftening(excess=rng.uniform(0.0, 0.4), kept=rng.uniform(), presses=rng.uniform(0.2, 2.0)),
    ]
    history, foam = presses(4, places=2), [every[k] for k in rng.choice(3, 2, replace=False)]
    force = foam_force_n(history, PAD, SOFT_SUPPORT, FOAM_M, foam)
    monkeypatch.setattr("ertskin.physics.mechanics.reaction._ROUNDS", 150)
    np.testing.assert_allclose(foam_force_n(history, PAD, SOFT_SUPPORT, FOAM_M, foam), force, atol=1e-3)


def test_foam_on_the_edge_of_the_virgin_curve_stays_there() -> None:
    """On it the foam is stiffer and sinks less than it has, below it softer and sinks more: it sinks as it has."""
    history = presses(2)
    effect = FoamSoftening(excess=0.5, presses=0.5)
    force = foam_force_n(history, PAD, SOFT_SUPPORT, FOAM_M, [effect])[:, 0]
    sink = (history.depth_m[:, 0] - force / SOFT_SUPPORT).reshape(2, -1)
    first, again = sink[:, 8]
    assert again == pytest.approx(first, abs=1e-9)
    seen_before = PAD * first * (1 + 0.5 * np.exp(-1 / 0.5))
    assert seen_before < force.reshape(2, -1)[1, 8] <= PAD * first * 1.5 + 1e-4


def test_viscoelastic_force_relaxes_to_the_elastic_one() -> None:
    history = presses(1, hold_s=500.0)
    force = foam_force_n(history, PAD, SUPPORT, FOAM_M, [ViscoelasticFoam(fraction=0.3, time_s=5.0)])[:, 0]
    elastic = foam_force_n(history, PAD, SUPPORT, FOAM_M)[:, 0]
    assert force[8] > 1.05 * elastic[8]
    assert force[9] == pytest.approx(elastic[9], rel=1e-3)
    assert force.min() >= 0


def test_hysteresis_unloads_below_loading_and_closes() -> None:
    history = presses(1)
    force = foam_force_n(history, PAD, np.inf, FOAM_M, [FoamHysteresis(loss=0.1, reversal=0.1)])[:, 0]
    elastic = foam_force_n(history, PAD, np.inf, FOAM_M)[:, 0]
    np.testing.assert_allclose(force[1:9], 1.1 * elastic[1:9], rtol=1e-5)
    np.testing.assert_allclose(force[11:], 0.9 * elastic[11:], rtol=1e-5)


def there_and_back() -> Strokes:
    """A touch that comes in to 3 mm, goes back to 1 mm, comes in to 4 mm and leaves; then another to 1 mm."""
    sink_m = 1e-3 * np.array([0, 1, 2, 3, 2, 1, 2, 3, 4, 0, 1.0])
    still = np.zeros(len(sink_m), dtype=np.intp)
    return Strokes(sink_m, PAD * sink_m, np.arange(11.0), sink_m > 0, still, still.astype(np.int64), FOAM_M)


def test_hysteresis_by_strain_is_solid_friction() -> None:
    """Dahl: a way x into one direction leaves exp(-x/slide) of what lacks to that side."""
    strokes = there_and_back()
    effect = FoamHysteresis(loss=0.1, slide=0.2, driven_by="strain")
    side = (effect.reaction_n(strokes.elastic_n, strokes)[1:9] / strokes.elastic_n[1:9] - 1) / 0.1
    way = np.exp(-0.25 / 0.2)
    first = 1 - way ** np.arange(1, 4)
    back = -1 + (first[2] + 1) * way ** np.arange(1, 3)
    np.testing.assert_allclose(side, [*first, *back, *(1 + (back[1] - 1) * way ** np.arange(1, 4))])
    assert effect.reaction_n(strokes.elastic_n, strokes)[10] == pytest.approx(PAD * 1e-3 * (1 + 0.1 * first[0]))


@pytest.mark.parametrize("shape", [0.5, 2.0])
def test_hysteresis_by_energy_follows_one_curve_below_the_deepest_of_a_touch(shape: float) -> None:
    strokes = there_and_back()
    effect = FoamHysteresis(loss=0.1, shape=shape, driven_by="energy")
    factor = effect.reaction_n(strokes.elastic_n, strokes)[[1, 2, 3, 4, 5, 6, 7, 8, 10]] / (PAD * 1e-3)
    factor /= np.array([1, 2, 3, 2, 1, 2, 3, 4, 1])
    less = [0.9 + 0.2 * (part / 3) ** (2 * shape) for part in (2, 1, 2)]
    np.testing.assert_allclose(factor, [1.1, 1.1, 1.1, *less, 1.1, 1.1, 1.1])


def test_hysteresis_says_by_what_it_may_be_driven() -> None:
    with pytest.raises(ValueError, match="one of force, sinking, strain, energy, not 'heat'"):
        FoamHysteresis(driven_by="heat")


def test_first_press_of_a_place_is_stiffer() -> None:
    effect = FoamSoftening(excess=0.2, kept=1.0, presses=0.2)
    again = foam_force_n(presses(2), PAD, np.inf, FOAM_M, [effect])[:, 0].reshape(2, -1)
    elsewhere = foam_force_n(presses(2, places=2), PAD, np.inf, FOAM_M, [effect])[:, 0].reshape(2, -1)
    assert again[0, 8] / again[1, 8] == pytest.approx(1.2 / (1 + 0.2 * np.exp(-5)), rel=1e-6)
    assert elsewhere[0, 8] == pytest.approx(elsewhere[1, 8])


def test_foam_softened_by_energy_comes_back_to_the_virgin_curve_where_it_has_not_been() -> None:
    """Ogden and Roxburgh: what earlier presses have put in counts, at 1 the first press knows nothing of it."""
    effect = FoamSoftening(excess=0.2, kept=1.0, scale=0.1, driven_by="energy")
    first, again = foam_force_n(presses(2), PAD, np.inf, FOAM_M, [effect])[:, 0].reshape(2, -1)
    elastic = foam_force_n(presses(1), PAD, np.inf, FOAM_M)[:, 0]
    np.testing.assert_allclose(first, 1.2 * elastic, rtol=1e-6)
    energy = (presses(1).depth_m[1:9, 0] / FOAM_M) ** 2
    virgin = 1 - erf((energy[-1] - energy) / 0.1)
    np.testing.assert_allclose(again[1:9], elastic[1:9] * (1 + 0.2 * virgin), rtol=1e-5)
    assert again[8] == pytest.approx(first[8])
    at_once = foam_force_n(presses(1), PAD, np.inf, FOAM_M, [replace(effect, kept=0.0)])[:, 0]
    np.testing.assert_allclose(at_once[:9], first[:9], rtol=1e-6)
    np.testing.assert_allclose(at_once[11:], again[11:], rtol=1e-6)


def test_foam_softened_by_work_goes_on_softening_at_the_same_depth() -> None:
    effect = FoamSoftening(excess=0.2, scale=0.5, driven_by="work")
    deepest = foam_force_n(presses(4), PAD, np.inf, FOAM_M, [effect])[:, 0].reshape(4, -1)[:, 8]
    elastic = foam_force_n(presses(1), PAD, np.inf, FOAM_M)[8, 0]
    put_in = np.arange(1, 5) * (np.nanmax(presses(1).depth_m) / FOAM_M) ** 2
    np.testing.assert_allclose(deepest, elastic * (1 + 0.2 * np.exp(-put_in / 0.5)), rtol=1e-5)


def test_force_relaxes_with_the_logarithm_of_time_over_decades_of_time_constants() -> None:
    """Against Fung's reduced relaxation function, a step at once: 1 + c (E1(t/tau2) - E1(t/tau1)) / ln(tau2/tau1)."""
    time_s = np.r_[0.0, 1e-9, np.geomspace(1.0, 30.0, 8)]
    step = np.r_[0.0, np.ones(9)]
    still = np.zeros(10, dtype=np.intp)
    strokes = Strokes(1e-3 * step, step, time_s, step > 0, still, still.astype(np.int64), FOAM_M)
    force = ViscoelasticFoam(fraction=0.4, time_s=0.1, decades=3.0, remembers_air=True).reaction_n(step, strokes)
    fung = 1 + 0.4 * (exp1(time_s[2:] / 100.0) - exp1(time_s[2:] / 0.1)) / np.log(1000.0)
    np.testing.assert_allclose(force[2:], fung, atol=0.4 * 0.05)
    assert force[1] == pytest.approx(1.4)


@pytest.mark.parametrize("stiffening", [-0.3, 0.7, 5.0])
def test_what_a_nonlinear_foam_carries_the_sheet_does_not_feel(stiffening: float) -> None:
    pad, foam_m = 2000.0, 6e-3
    sink = np.linspace(0, 4e-3, 9)
    force = pad * sink * (1 + stiffening * (sink / foam_m) ** 2)
    whole = NonlinearFoam(stiffening=stiffening, carried=0.0).felt_n(force, pad, foam_m)
    linear = NonlinearFoam(stiffening=stiffening, carried=1.0).felt_n(force, pad, foam_m)
    half = NonlinearFoam(stiffening=stiffening, carried=0.5).felt_n(force, pad, foam_m)
    np.testing.assert_allclose(whole, force)
    np.testing.assert_allclose(linear, pad * sink, atol=1e-9)
    np.testing.assert_allclose(half, (force + pad * sink) / 2, atol=1e-9)


def test_foam_that_gives_way_is_felt_as_no_more_than_its_largest_force_alone() -> None:
    foam, pad, foam_m = NonlinearFoam(stiffening=-0.8, exponent=6.0, carried=1.0), 1000.0, 4e-3
    linear = foam.felt_n(np.linspace(0.0, 100.0, 41), pad, foam_m)
    turns = pad * foam_m * (1 / (7 * 0.8)) ** (1 / 6)
    assert np.isfinite(linear).all()
    assert (np.diff(linear) >= -1e-9).all()
    assert linear[-1] == pytest.approx(turns)
