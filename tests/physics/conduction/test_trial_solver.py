"""Presses solved in part, and trials put together from single contacts and a coarser mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from sheets import padded_sheet, small_sheet

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.pressed_sheet import PiezoLaw, PressedSheet
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.conduction.trials import Level, TrialSolver
from ertskin.physics.protocol import Protocol, electrode_pairs

NOISE_V = 2e-3
PROTOCOL = Protocol.against_sink(electrode_pairs(5), 5, 1e-3)
CONTACT = np.array([20.0, 50.0, 120.0, 300.0, 75.0])
PLACES = np.array([[0.0085, 0.010], [0.0205, 0.010], [0.014, 0.0155], [0.015, 0.004]])
COARSE = Resolution(2, Grading(cell_m=1.4e-3, rim_m=8e-4, growth=4.0))
FINE = Resolution(3, Grading(cell_m=8e-4, rim_m=4e-4, growth=4.0))


@dataclass(frozen=True)
class Bump:
    """A bell of pressure 2 mm wide."""

    width_m: float = 2e-3

    def at(self, offset_m: np.ndarray) -> np.ndarray:
        return 2e4 * np.exp(-(offset_m**2).sum(axis=-1) / (2 * self.width_m**2))

    def radius_m(self, fraction: float) -> float:
        return self.width_m * np.sqrt(-2 * np.log(fraction))


@dataclass(frozen=True)
class Pad:
    """A pressure like the paper's pad under a 10 mm indenter: 16 kPa per newton in the middle, a long weak tail."""

    def at(self, offset_m: np.ndarray) -> np.ndarray:
        square = (offset_m**2).sum(axis=-1)
        return 1.58e4 * np.exp(-square / (2 * 3.2e-3**2)) + 60.0 * np.exp(-np.sqrt(square + 1e-6) / 9e-3)

    def radius_m(self, fraction: float) -> float:
        return 9e-3 * np.log(60.0 / (1.58e4 * fraction))


class Saturating:
    """A sheet resistance that falls to a quarter and stays."""

    def sheet_resistance_ohm_sq(self, pressure_pa: np.ndarray) -> np.ndarray:
        return 1_000.0 * (1 - 0.75 * np.clip(pressure_pa / 6e4, 0, 1))


@dataclass(frozen=True)
class Levelling:
    """The same without a kink."""

    rest_ohm_sq: float = 1_000.0

    def sheet_resistance_ohm_sq(self, pressure_pa: np.ndarray) -> np.ndarray:
        return self.rest_ohm_sq * (0.25 + 0.75 * (1 - np.clip(pressure_pa / 6e4, 0, 1)) ** 3)


def pressed(resolution: Resolution, tail: float, law: PiezoLaw | None = None) -> PressedSheet:
    return PressedSheet(SheetModel(small_sheet(), resolution), Bump(), law or Saturating(), CONTACT, tail)


@pytest.fixture(scope="module")
def fine() -> PressedSheet:
    return pressed(FINE, 0.0)


@pytest.fixture(scope="module")
def solver(fine: PressedSheet) -> TrialSolver:
    levels = [Level(0.0, pressed(COARSE, 1e-4)), Level(0.011, pressed(Resolution(1, COARSE.grading), 1e-4))]
    return TrialSolver(fine, levels, PLACES, 10.0)


def random_presses(count: int, contacts: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    chosen = np.array([rng.choice(len(PLACES), contacts, replace=False) for _ in range(count)])
    return PLACES[chosen], rng.uniform(0.0, 10.0, (count, contacts))


def error_v(got: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.sqrt((PROTOCOL.whitened(got - expected) ** 2).mean(axis=1))


def test_a_press_solved_in_part_is_the_press(fine: PressedSheet) -> None:
    contact, force = random_presses(5, 2, 0)
    part = pressed(FINE, 1e-9)
    assert part.solve(contact[0], force[0]).origin is part.rest
    expected = fine.pair_resistances(contact, force)
    np.testing.assert_allclose(part.pair_resistances(contact, force), expected, rtol=1e-8)


@pytest.mark.parametrize(("contacts", "share"), [(1, 0.05), (2, 0.1), (3, 0.2)])
def test_trials_agree_with_the_fine_mesh(fine: PressedSheet, solver: TrialSolver, contacts: int, share: float) -> None:
    contact, force = random_presses(30, contacts, contacts)
    error = error_v(solver.pair_resistances(contact, force), fine.pair_resistances(contact, force))
    assert np.sqrt((error**2).mean()) < share * NOISE_V
    signal = error_v(fine.pair_resistances(contact, force), fine.rest.pair_resistance_ohm)
    assert signal.mean() > 10 * NOISE_V


def test_near_pairs_leave_little() -> None:
    fine, levels = pressed(FINE, 0.0, Levelling()), [Level(0.0, pressed(COARSE, 1e-3, Levelling()))]
    without = TrialSolver(fine, levels, PLACES, 10.0)
    near = TrialSolver(fine, levels, PLACES, 10.0, near_m=0.02)
    for contacts in (2, 3):
        contact, force = random_presses(20, contacts, 5)
        exact, got = fine.pair_resistances(contact, force), near.pair_resistances(contact, force)
        before, after = (
            np.linalg.norm(error_v(each, exact)) for each in (without.pair_resistances(contact, force), got)
        )
        assert after < 0.25 * before
        np.testing.assert_array_equal(near.pair_resistances(contact[7:], force[7:]), got[7:])
        np.testing.assert_allclose(near.pair_resistances(contact[:, ::-1], force[:, ::-1]), got, rtol=1e-12)


def test_what_pairs_do_together_is_as_good_from_a_table() -> None:
    fine, sheet = pressed(FINE, 0.0, Levelling()), pressed(COARSE, 1e-4, Levelling())
    solved, tabulated = (
        TrialSolver(fine, [Level(0.0, sheet), Level(0.011, sheet, table)], PLACES, 10.0) for table in (False, True)
    )
    contact, force = random_presses(40, 2, 5)
    exact, got = (each.pair_resistances(contact, force) for each in (solved, tabulated))
    far = np.hypot(*(contact[:, 0] - contact[:, 1]).T) >= 0.011
    first, second = (solved.pair_resistances(contact[:, [k]], force[:, [k]]) for k in (0, 1))
    together = error_v(exact + fine.rest.pair_resistance_ohm, first + second)
    np.testing.assert_array_equal(got[~far], exact[~far])
    error = error_v(got[far], exact[far])
    assert (error > 0).all()
    # Some 5 % of it, here as on the paper's sheet and pad.
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(together[far])
    three, weights = random_presses(3, 3, 6)
    np.testing.assert_array_equal(tabulated.pair_resistances(three, weights), solved.pair_resistances(three, weights))


def test_a_tenth_of_the_noise_for_the_hardest_neighbours() -> None:
    """The bound of the module's head: the paper's sheet, taxels 20, 28 and 40 mm apart, 10 N on each."""
    places = np.array([[0.03, 0.03], [0.05, 0.03], [0.05, 0.05], [0.03, 0.07]])
    protocol, contact_ohm = Protocol.against_sink(electrode_pairs(24), 24, 1e-4), np.geomspace(100.0, 1000.0, 24)
    solver = TrialSolver.of(padded_sheet(), Pad(), Levelling(18_000.0), contact_ohm, places, 10.0)
    fine = PressedSheet(SheetModel(padded_sheet(), "fine"), Pad(), Levelling(18_000.0), contact_ohm, 0.0)
    contact = places[np.argwhere(np.triu(np.ones((4, 4)), 1))]
    force = np.full((6, 2), 10.0)
    error = solver.pair_resistances(contact, force) - fine.pair_resistances(contact, force)
    assert np.sqrt((protocol.whitened(error) ** 2).mean(axis=1)).max() < 0.1 * NOISE_V


def test_the_same_whatever_the_workers(solver: TrialSolver) -> None:
    contact, force = random_presses(150, 2, 9)
    once = solver.pair_resistances(contact, force)
    np.testing.assert_array_equal(solver.pair_resistances(contact, force, workers=2), once)
    np.testing.assert_array_equal(solver.pair_resistances(contact[70:], force[70:]), once[70:])


def test_absent_contacts(solver: TrialSolver) -> None:
    contact, force = random_presses(4, 2, 1)
    force[:2, 1] = np.nan
    contact[:2, 1] = np.nan
    force[1] = np.nan
    got = solver.pair_resistances(contact, force)
    np.testing.assert_array_equal(got[0], solver.pair_resistances(contact[:1, :1], force[:1, :1])[0])
    np.testing.assert_allclose(got[1], solver.pair_resistances(contact[:1, :1], np.zeros((1, 1)))[0], rtol=1e-14)
    assert solver.pair_resistances(contact[:0], force[:0]).shape == (0, 10)


def test_what_was_not_prepared_is_refused(solver: TrialSolver) -> None:
    contact, force = random_presses(2, 2, 1)
    with pytest.raises(ValueError, match="place"):
        solver.pair_resistances(contact + 1e-3, force)
    with pytest.raises(ValueError, match="beyond"):
        solver.pair_resistances(contact, force + 10.0)
    np.testing.assert_array_equal(solver.covers(contact, force), [True, True])
    force[0, 1] = 10.5
    np.testing.assert_array_equal(solver.covers(contact, force), [False, True])
