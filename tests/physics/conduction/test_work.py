"""How much work a solve is, counted: multiplications, eliminations, substitutions. A guard against slow changes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from sheets import padded_sheet, tank
from test_trial_solver import COARSE, FINE, PLACES, pressed, random_presses

from ertskin.physics.conduction import multifrontal
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.multifrontal import Fronts
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.conduction.trials import Level, TrialSolver


def multiplications(fronts: Fronts, which: np.ndarray | slice = slice(None)) -> int:
    """Products of a Cholesky elimination of the fronts' pivots, upper triangles only."""
    size, pivots = fronts.size[which], fronts.pivots[which]
    return sum(int(((m - np.arange(p)) * (m - np.arange(p) + 1) // 2).sum()) for m, p in zip(size, pivots, strict=True))


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts calls of the compiled loops."""
    calls: Counter[str] = Counter()

    def counted(name: str) -> None:
        original = getattr(multifrontal, name)

        def call(*arguments: object) -> object:
            calls[name] += 1
            return original(*arguments)

        monkeypatch.setattr(multifrontal, name, call)

    for name in ("_eliminate", "_substitute", "_substitute_back"):
        counted(name)
    return calls


@pytest.mark.parametrize(
    ("sensor", "resolution", "unknowns", "millions"),
    [
        (tank(24, 192), Resolution(1, Grading(3.8e-3, 3.8e-3)), 2_600, 1.5),
        (tank(24, 384), Resolution(1, Grading(1.8e-3, 1.8e-3)), 10_500, 12.5),
        (padded_sheet(), "fast", 18_500, 17.0),
        (padded_sheet(), "fine", 41_500, 72.0),
    ],
)
def test_elimination_stays_sparse(sensor: object, resolution: object, unknowns: int, millions: float) -> None:
    model = SheetModel(sensor, resolution)  # type: ignore[arg-type]
    assert model.space.nodes <= unknowns
    assert multiplications(model.fronts) <= millions * 1e6


def test_a_transfer_matrix_takes_one_elimination_and_no_right_hand_side(count: Counter[str]) -> None:
    sheet = pressed(COARSE, 1e-4)
    count.clear()
    solution = sheet.sheet.solve(sheet.rest.conductivity_s, 50.0)
    assert solution.pair_resistance_ohm.shape == (10,)
    assert count == {"_eliminate": 1}
    solution.jacobian_conductivity()
    solution.jacobian_contact_resistance()
    solution.directional(sheet.rest.conductivity_s)
    assert count == {"_eliminate": 1, "_substitute_back": 1}


def test_a_press_eliminates_a_part_of_the_sheet() -> None:
    model = SheetModel(padded_sheet(), "fast")
    near = ((model.quadrature_m - [0.07, 0.05]) ** 2).sum(axis=2) < 0.01**2
    base = model.solve(model.uniform(18_000.0), 200.0)
    part = model.solve_again(np.where(near, 4.0, 1.0) * base.conductivity_s, base).factor.dirty
    assert part.sum() < 0.1 * len(part)
    assert multiplications(model.fronts, part) < 0.3 * multiplications(model.fronts)


def test_single_contacts_take_no_solve_and_pairs_one(count: Counter[str]) -> None:
    solver = TrialSolver(pressed(FINE, 0.0), [Level(0.0, pressed(COARSE, 1e-4))], PLACES, 10.0, forces=6)
    assert count["_eliminate"] == 2 + 2 * 6 * len(PLACES)
    count.clear()
    contact, force = random_presses(20, 2, 0)
    force[:8, 1] = np.nan
    solver.pair_resistances(contact, force)
    assert count == {"_eliminate": 12}
