"""The film study's parts: places are found from other recordings, never from the presses that are predicted."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "real" / "velostat"
MODULES = ("run", "figures", "forms", "film")


@pytest.fixture(scope="module")
def study():
    """The study's modules, which live outside any package; other studies have files of the same names."""
    sys.path.insert(0, str(STUDY))
    import film
    import forms
    import run

    yield run, forms, film
    sys.path.remove(str(STUDY))
    for name in MODULES:
        sys.modules.pop(name, None)


def made_up(film, peak_pa: float, log_sensitivity: np.ndarray, seed: int = 0):
    """Sixteen presses on contacts whose conductance is 1e-3 + 2e-3 p/10 kPa, each press felt by its own factor."""
    rng = np.random.default_rng(seed)
    shape = np.concatenate([np.zeros(4), np.linspace(0, 1, 8), np.ones(12), np.linspace(1, 0, 4), np.zeros(8)])
    peaks = peak_pa * rng.uniform(0.9, 1.0, film.PRESSES)
    stress = (peaks[:, None] * shape).ravel()
    press = np.repeat(np.arange(film.PRESSES), len(shape))
    conductance = 1e-3 + 2e-3 * stress * np.exp(log_sensitivity[press]) / 1e4
    resistance = np.exp(0.01 * rng.standard_normal(len(stress))) / conductance
    return film.Film(5, stress, resistance, 0.05 * np.arange(len(stress)), press)


def test_sensitivities_are_found_and_predict_presses_from_another_force(study):
    run, forms, film = study
    true = 0.4 * np.random.default_rng(3).standard_normal(film.PRESSES)
    weak, strong = made_up(film, 5e4, true), made_up(film, 1e5, true, seed=1)
    form = forms.Form(places="sensitivity")
    model = form.fit([weak], [weak.early])
    late = ~strong.early & strong.loaded
    known = run.from_other_forces(form, model, [weak])
    assert known - known.mean() == pytest.approx(true - true.mean(), abs=0.03)
    assert run.rms(model, strong, known, late) < 0.03
    assert run.rms(model, strong, model.log_sensitivity, late) > 0.1


def test_presses_that_are_predicted_do_not_move_the_fit(study):
    _, forms, film = study
    true = np.zeros(film.PRESSES)
    one = made_up(film, 5e4, true)
    spoilt = replace(one, resistance=np.where(one.early, one.resistance, 7.0))
    form = forms.Form(places="sensitivity")
    fits = [form.fit([test], [test.early]).x for test in (one, spoilt)]
    assert np.array_equal(*fits)


def test_contacts_age_with_the_logarithm_of_the_time_since_they_moved(study):
    _, forms, _ = study
    time_s = np.array([0.0, 1.0, 1.01, 2.01, 11.01])
    pressure = np.array([1e3, 1e3, 1e5, 1e5, 1e5])[:, None]
    contacts = forms.AgeingContacts(rate=0.1, change=0.05, shortest_s=0.1)
    factor = np.ravel(contacts.resistance_factor(pressure, np.zeros((1, 2)), time_s, np.zeros((2, 2))))
    old = forms.OLD_S + 1.0
    assert factor[1] == pytest.approx((1 + old / 0.1) ** -0.1)
    renewed = 0.01 * 0.05 / np.log((1e5 + forms.RENEWED_PA) / (1e3 + forms.RENEWED_PA))
    assert factor[2:] == pytest.approx((1 + (renewed + np.array([0.0, 1.0, 10.0])) / 0.1) ** -0.1, rel=1e-6)


def test_a_relay_stays_on_until_the_stress_falls_below(study):
    _, forms, _ = study
    stress = np.array([0, 2, 4, 6, 4, 2, 1, 0, 4.0])
    assert forms._relay(stress, 5.0, 2.0).tolist() == [0, 0, 0, 1, 1, 1, 0, 0, 0]
