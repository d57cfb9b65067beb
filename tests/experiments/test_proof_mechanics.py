"""The generator's layered pad and memories against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from generator.effect import Effect
from generator.foam import Pad
from generator.layered import Layer, point_pressure, stiffness_n_per_m
from generator.mechanics import BoucWenFoam, DamagedFoam, EnergyUnloadingFoam, FractionalFoam, OgdenRoxburghFoam
from generator.memory import AdheringContacts, Ageing, ColemanHodgdon, Spectrum, fractional, quasilinear, stretched
from generator.protocol import Plan
from generator.skin import Skin
from scipy.special import erf, erfcx, gamma
from small_proof_skin import LAYERS, small_skin


def test_deep_stack_is_boussinesq() -> None:
    layers = (Layer("a", 0.004, 1e5, 0.3), Layer("b", 0.3, 1e5, 0.3))
    r = np.array([0.0, 0.002, 0.004, 0.008])
    expected = 3 * 0.004**3 / (2 * np.pi * (r**2 + 0.004**2) ** 2.5)
    np.testing.assert_allclose(point_pressure(layers, 0)(r), expected, rtol=2e-3)


def test_the_pad_carries_the_whole_force() -> None:
    r = np.linspace(0, 0.06, 4001)
    assert np.trapezoid(point_pressure(LAYERS, 2)(r) * 2 * np.pi * r, r) == pytest.approx(1.0, abs=1e-4)


def test_thin_confined_pad_is_as_stiff_as_its_oedometer() -> None:
    layer = Layer("thin", 2e-4, 1e5, 0.3)
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    disk = [0.01 * np.sqrt((n + 0.5) / 12) * np.stack([np.cos(angle), np.sin(angle)], 1) for n in range(12)]
    oedometer = 1e5 * 0.7 / (1.3 * 0.4) * np.pi * 0.01**2 / 2e-4
    assert stiffness_n_per_m((layer,), 0, 0.02, np.concatenate(disk)) == pytest.approx(oedometer, rel=0.05)


def test_half_order_relaxation_is_erfcx() -> None:
    t = np.array([0.1, 1.0, 10.0])
    np.testing.assert_allclose(fractional(t, 2.0, 0.5), 1 - erfcx(np.sqrt(t / 2.0)), atol=2e-4)


@pytest.mark.parametrize(
    "growth",
    [lambda t: stretched(t, 12.0, 0.5), lambda t: fractional(t, 4.0, 0.55), lambda t: quasilinear(t, 0.15, 90.0)],
)
def test_modes_follow_the_kernel(growth) -> None:  # type: ignore[no-untyped-def]
    late = Spectrum(growth, 1)
    late.advance(np.zeros(1), 0.0)
    late.advance(np.ones(1), 1e-6)
    times = np.cumsum(np.full(30, 1.0))
    found = [float(late.advance(np.ones(1), 1.0)[0]) for _ in times]
    np.testing.assert_allclose(found, growth(times), atol=6e-3)


def test_lags_forget_how_fast_and_how_finely_they_were_driven() -> None:
    for make in (lambda: ColemanHodgdon(2.0, 0.6, 1), lambda: AdheringContacts(0.6, 1)):
        once, often = make(), make()
        for x in (5.0, 1.0, 4.0):
            coarse = once.advance(np.array([x]))
        for a, b in ((0.0, 5.0), (5.0, 1.0), (1.0, 4.0)):
            for x in np.linspace(a, b, 50):
                fine = often.advance(np.array([x]))
        np.testing.assert_allclose(coarse, fine, rtol=1e-9)


def test_adhering_contacts_rise_straight_and_open_late() -> None:
    contacts = AdheringContacts(0.5, 1)
    assert contacts.advance(np.array([3.0]))[0] == 3.0
    assert 1.0 < contacts.advance(np.array([1.0]))[0] < 2.0
    assert contacts.advance(np.array([0.0]))[0] == 0.0


def test_contacts_age_while_held_and_are_young_again_in_air() -> None:
    age = Ageing(10.0, 6.0, 1)
    age.advance(np.array([1e4]), 0.5)
    assert age.advance(np.array([1e4]), 8.0)[0] == pytest.approx(8.5, rel=0.1)
    age.advance(np.zeros(1), 0.5)
    assert age.advance(np.zeros(1), 20.0)[0] < 0.3


def pressed(effect, depth: np.ndarray, since_s: float) -> np.ndarray:  # type: ignore[no-untyped-def, type-arg]
    pad = Pad(1000.0, 1e12, 0.004, [effect.foam()])
    pad.begin(np.zeros(2))
    return np.array([pad.advance(float(d), since_s)[0] for d in depth])


def test_foam_relaxes_to_the_share_it_says() -> None:
    force = pressed(FractionalFoam(0.4), np.concatenate([[0.0], np.full(4000, 1e-3)]), 1.0)
    assert force[-1] == pytest.approx(1.0 - 0.4 * (1.0 - (4.0 / 4000.0) ** 0.55 / gamma(0.45)), abs=2e-3)


@pytest.mark.parametrize("kind", [BoucWenFoam, EnergyUnloadingFoam])
def test_foam_loses_work_over_a_cycle_at_any_speed(kind) -> None:  # type: ignore[no-untyped-def]
    way = np.concatenate([np.linspace(0, 2e-3, 40), np.linspace(2e-3, 0, 40)[1:]])
    slow, fast = pressed(kind(0.2), way, 10.0), pressed(kind(0.2), way, 0.01)
    np.testing.assert_allclose(slow, fast)
    assert 0.02 < np.trapezoid(slow, way) / np.trapezoid(slow[:40], way[:40]) < 0.5


def pressed_to(deepest_m: float, levels: int) -> Skin:
    """The small skin, pressed less deep first and then to the deepest, in levels as recorded."""
    skin, share = small_skin(), np.arange(1, levels + 1) / levels
    first, second, third = skin.plan.presses
    deep = replace(second, depth_m=np.round(deepest_m * share, 6))
    return replace(skin, plan=Plan((replace(first, depth_m=np.round(0.7 * deepest_m * share, 6)), deep, third)))


def recorded_halfway(effect: Effect, depth_m: np.ndarray) -> float:  # type: ignore[type-arg]
    """What the third of three presses of a pad lacks of the first in the frame of level n/2; two holds, and back."""
    pad, force = Pad(1000.0, 1e12, 0.004, [effect.foam()]), []  # type: ignore[list-item]
    for _ in range(3):
        pad.begin(np.zeros(2))
        way = [*depth_m, depth_m[-1], depth_m[-1], *depth_m[-2::-1], 0.0]
        force.append([pad.advance(float(depth), 0.5)[0] for depth in way][len(depth_m) // 2 - 1])
    return float(1.0 - force[2] / force[0])


SIZES = pytest.mark.parametrize("size", [0.0, 0.1, 0.6])


# Deeper than the press of 3 mm that the plan ends with; half of 3.205 mm isn't a whole micrometre.
@SIZES
@pytest.mark.parametrize(("deepest_m", "levels"), [(3.2e-3, 2), (3.2e-3, 4), (3.205e-3, 8), (3.205e-3, 6)])
def test_work_softens_the_third_press_as_much_as_it_says(size: float, deepest_m: float, levels: int) -> None:
    skin = pressed_to(deepest_m, levels)
    depth = skin.plan.presses[1].depth_m
    # Damage settles by 0.5 * (0.8 * 4 mm)2 times the stiffness; a step does its way times the force at its end.
    work = np.cumsum(np.diff(depth, prepend=0.0) * depth) / (0.5 * 3.2e-3**2)
    before = work[levels // 2 - 2] if levels > 2 else 0.0
    lost = size * (np.exp(-before) - np.exp(-before - 2 * work[-1])) / (1.0 - size * -np.expm1(-before))
    said = DamagedFoam(size).meaning(skin)["softened_third_press"]
    assert said == pytest.approx(lost, abs=1e-12)
    assert said == pytest.approx(recorded_halfway(DamagedFoam(size), depth), abs=1e-6)
    assert said > 0.0 if size else said == 0.0


@SIZES
@pytest.mark.parametrize(("deepest_m", "levels"), [(1.2e-3, 2), (1.2e-3, 4), (1.205e-3, 8), (3.2e-3, 6)])
def test_energy_taken_softens_the_third_press_as_much_as_it_says(size: float, deepest_m: float, levels: int) -> None:
    skin = pressed_to(deepest_m, levels)
    skin = replace(skin, plan=Plan(skin.plan.presses[:2]))
    depth = skin.plan.presses[1].depth_m
    # The energy between halfway and the deepest, over that of 0.3 * 4 mm.
    lost = size * erf((depth[-1] ** 2 - depth[levels // 2 - 1] ** 2) / 1.2e-3**2)
    said = OgdenRoxburghFoam(size).meaning(skin)["softened_third_press"]
    assert said == pytest.approx(lost, abs=1e-12)
    assert said == pytest.approx(recorded_halfway(OgdenRoxburghFoam(size), depth), abs=1e-6)
    assert said > 0.0 if size else said == 0.0
