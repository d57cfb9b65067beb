"""Every form's law is measured, and the table of forms says what was found."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from generator.forms import FORMS
from isolated_laws import ELSEWHERE, IN_PART, MEASURED, SEEDS, field, left_of, skin_of, smooth_bases
from rows import CLASSES, FormClasses

from ertskin.diagnosis.search.smooth_fields import MOST_MODES
from ertskin.physics.effects.effect import Effect, Start
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

PROOF = Path(__file__).parents[2] / "experiments" / "concealed" / "proof"
LAWS = PROOF / "isolated_laws.json"
QUICK = "indenter_offset", "sheet_anisotropy", "electrode_displacement", "contact_drift", "scan_skew", "self_heating"


def test_every_form_is_in_the_table_with_what_was_measured() -> None:
    measured = json.loads(LAWS.read_text())
    table = (PROOF / "README.md").read_text().split("## Forms")[1]
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \| ([^|]*) \| (\w+) \|", table, re.MULTILINE)
    said = {f"{name}/{form}": (left, of) for name, form, left, of in rows}
    assert set(said) == {f"{name}/{kind.form}" for name, kinds in FORMS.items() for kind in kinds}
    classes = FormClasses({key: one["left"] for key, one in measured.items()})
    for key, (left, of) in said.items():
        assert (left, of) == (f"{100 * measured[key]['left']:.1f} %", classes.of(*key.split("/"))), key


@pytest.mark.parametrize("page", ["README.md", "development.md", "../README.md"])
def test_every_page_says_how_many_forms_are_in_each_class(page: str) -> None:
    measured = json.loads(LAWS.read_text())
    classes = FormClasses({key: one["left"] for key, one in measured.items()})
    same, near, different = (sum(classes.of(*key.split("/")) == name for key in measured) for name in CLASSES)
    text = " ".join((PROOF / page).read_text().split())
    said = rf"\b{len(measured)}\b.{{,50}}\b{same} .{{,20}}same.{{,60}}\b{near} near.{{,30}}\b{different} different"
    assert re.search(said, text)


def test_every_form_of_the_generator_has_a_measured_law_and_a_class() -> None:
    assert set(MEASURED) == set(FORMS)
    measured = json.loads(LAWS.read_text())
    assert set(measured) == {f"{name}/{kind.form}" for name, kinds in FORMS.items() for kind in kinds}
    classes = FormClasses({key: one["left"] for key, one in measured.items()})
    assert {classes.of(*key.split("/")) for key in measured} == set(CLASSES)


@pytest.mark.parametrize("name", QUICK)
def test_quick_laws_leave_what_was_measured(name: str) -> None:
    # What warmth leaves differs from one machine to another with the same code: 0.238 and 0.243.
    measured, skin = json.loads(LAWS.read_text()), skin_of(SEEDS[0])
    for kind in FORMS[name]:
        expected = measured[f"{name}/{kind.form}"]["by_skin"][0]
        assert MEASURED[name](kind, skin) == pytest.approx(expected, abs=6e-3 if name == "self_heating" else 2e-3)


@pytest.mark.parametrize("form", ["rolls", "hills"])
def test_a_field_is_fitted_with_a_step_and_with_a_smooth_field(form: str) -> None:
    measured, skin = json.loads(LAWS.read_text()), skin_of(SEEDS[0])
    kind = next(kind for kind in FORMS["sheet_inhomogeneity"] if kind.form == form)
    assert field(kind, skin) == pytest.approx(measured[f"sheet_inhomogeneity/{form}"]["by_skin"][0], abs=2e-3)


def test_smooth_fields_are_orthonormal_and_without_a_mean() -> None:
    x = np.linspace(0.0, 0.12, 30)
    point = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    basis = next(smooth_bases(point, np.array([[0.0, 0.0], [0.12, 0.12]])))
    assert 3 < basis.shape[1] <= MOST_MODES
    assert basis.T @ basis == pytest.approx(np.eye(basis.shape[1]), abs=1e-4)
    assert np.abs(basis.mean(axis=0)).max() < 1e-6


def test_what_is_measured_in_part_is_as_the_table_s_text_says() -> None:
    measured, text = json.loads(LAWS.read_text()), (PROOF / "README.md").read_text()
    parts = {key: one["in_part"] for key, one in measured.items() if "in_part" in one}
    assert set(parts) == {f"{name}/{kind.form}" for name in IN_PART for kind in FORMS[name]}
    assert all(f"{100 * left:.1f} %" in text for part in parts.values() for left in part.values() if left > 0)


@pytest.mark.parametrize("name", ELSEWHERE)
def test_laws_measured_elsewhere_leave_what_was_measured(name: str) -> None:
    measured, skin = json.loads(LAWS.read_text()), skin_of(SEEDS[0])
    assert {key.split("/")[0] for key, one in measured.items() if "elsewhere" in one} == set(ELSEWHERE)
    for kind in FORMS[name]:
        said = measured[f"{name}/{kind.form}"]["elsewhere"]
        assert set(said) == set(ELSEWHERE[name])
        for what, measure in ELSEWHERE[name].items():
            assert measure(kind, skin) == pytest.approx(said[what]["by_skin"][0], abs=2e-3), what


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
