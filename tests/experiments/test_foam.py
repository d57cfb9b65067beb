"""The foam study's parts: no form is chosen with a look at the slow part it is judged by."""

from __future__ import annotations

import sys
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from ertskin.diagnosis.coupon.compression import prepared
from ertskin.diagnosis.coupon.diagnosis import regimes
from ertskin.hardware.measurement import Coupon
from ertskin.physics.effects.effect import Strokes
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam

STUDY = Path(__file__).resolve().parents[2] / "experiments" / "real" / "foam"
MODULES = ("run", "figures", "forms", "specimen")


@pytest.fixture(scope="module")
def study():
    """The study's modules, which live outside any package; other studies have files of the same names."""
    sys.path.insert(0, str(STUDY))
    import forms
    import run
    import specimen

    yield run, forms, specimen
    sys.path.remove(str(STUDY))
    for name in MODULES:
        sys.modules.pop(name, None)


def made_up(specimen, stiffness: float):
    """A relaxing foam of some stiffness: five fast cycles, a slow ramp, a hold."""
    corner_s = np.array([0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 28, 36.0])
    time_s = np.arange(0, 36, 0.08)
    strain = np.interp(time_s, corner_s, [0, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 0.5])
    count = len(time_s)
    strokes = Strokes(
        0.01 * strain,
        0.01 * strain,
        time_s,
        np.ones(count, dtype=bool),
        np.zeros(count, dtype=np.intp),
        np.ones(count, dtype=np.int64),
        0.01,
    )
    foam = ViscoelasticFoam(fraction=0.2, time_s=10.0, remembers_air=True)
    force_n = foam.reaction_n(stiffness * ((1 - strain) ** -4 - 1), strokes)
    force_n = force_n + 0.01 * np.random.default_rng(0).standard_normal(count)
    coupon = Coupon(time_s, 0.01 * (1 - strain), force_n, 0.01, 5e-5, "free")
    test = prepared(coupon)
    fast, slow, _ = regimes(test)
    return specimen.Specimen(coupon, test, fast, slow)


def test_the_choice_for_a_coupon_does_not_see_its_slow_part(study):
    run, forms, _ = study
    rng = np.random.default_rng(0)
    errors = {name: {key: list(rng.random(5)) for key in ("slow_n", "later_cycles_n")} for name in forms.FORMS}
    for judge in (run.by_others, run.by_later_cycles):
        before = run.chosen(errors, judge)["form"]
        for k in range(5):
            other = deepcopy(errors)
            for row in other.values():
                row["slow_n"][k] = rng.random()
            assert run.chosen(other, judge)["form"][k] == before[k]


def test_fits_never_see_the_slow_part(study):
    _, forms, specimen = study
    one = made_up(specimen, 0.3)
    spoilt = deepcopy(one)
    spoilt.test.force_n[spoilt.slow] = 100.0
    form = forms.Form((forms.RELAXATION,), forms.HELD)
    for fit in (forms.elastic_fit, form):
        np.testing.assert_allclose(fit([spoilt], [spoilt.fast])(one), fit([one], [one.fast])(one))


def test_a_memory_from_others_predicts_a_stiffer_coupon(study):
    _, forms, specimen = study
    others, fifth = [made_up(specimen, 0.3), made_up(specimen, 0.35)], made_up(specimen, 0.5)
    form = forms.Form((forms.RELAXATION,), forms.HELD)
    rows = [s.fast | s.slow for s in others]
    memory = form.remembering(others, rows)
    force_n = memory([fifth], [fifth.fast])(fifth)
    assert fifth.rmse_n(force_n, fifth.slow) < 0.03
    assert fifth.rmse_n(forms.elastic_fit([fifth], [fifth.fast])(fifth), fifth.slow) > 0.1
