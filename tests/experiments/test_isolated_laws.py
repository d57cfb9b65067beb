"""The table of forms says what was measured, and only that."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from generator.forms import FORMS
from isolated_laws import MEASURED, left_of

from ertskin.physics.effects.effect import Effect, Start
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

PROOF = Path(__file__).parents[2] / "experiments" / "concealed" / "proof"


def test_every_form_is_in_the_table_with_what_was_measured() -> None:
    measured = json.loads((PROOF / "isolated_laws.json").read_text())
    table = (PROOF / "README.md").read_text().split("## Forms")[1]
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \| ([^|]*) \|", table, re.MULTILINE)
    said = {f"{name}/{form}": left for name, form, left in rows}
    assert set(said) == {f"{name}/{kind.form}" for name, kinds in FORMS.items() for kind in kinds}
    assert set(measured) == {f"{name}/{kind.form}" for name in MEASURED for kind in FORMS[name]}
    for key, left in said.items():
        expected = f"{100 * measured[key]['left']:.1f} %" if key in measured else "not measured"
        assert left == expected, key


def test_a_law_of_the_same_form_leaves_nothing_and_another_leaves_itself() -> None:
    pressure = np.concatenate([np.linspace(0, 1, 30), np.linspace(1, 0, 30)])

    def felt(width: float) -> np.ndarray:
        asked = (pressure[:, None], np.zeros((1, 2)), pressure, np.zeros((2, 2)))
        return PiezoHysteresis(width=width).effective_pressure_pa(*asked)[:, 0]

    def missed(effect: Effect | None) -> np.ndarray:
        return felt(0.0 if effect is None else effect.width) - felt(0.17)

    start = Start(PiezoHysteresis(width=0.05), ("width",))
    assert left_of(iter([start]), missed) < 1e-3
    assert left_of(iter([start]), lambda effect: pressure) == pytest.approx(1.0)
