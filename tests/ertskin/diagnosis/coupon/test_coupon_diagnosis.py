"""A coupon's diagnosis: effects put into made-up tests are named, the slow part is predicted, bad tests are said so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ertskin.diagnosis.coupon.compression import plates_way, prepared
from ertskin.diagnosis.coupon.diagnosis import FORM, HELD, diagnose_coupon, regimes
from ertskin.diagnosis.coupon.fit import elastic_model, fit_coupon, rmse_n
from ertskin.diagnosis.output.figures import write_figures
from ertskin.diagnosis.output.report import write_report
from ertskin.hardware.measurement import Coupon
from ertskin.physics.effects.effect import FoamEffect, Strokes
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam

HEIGHT_M, AREA_M2, NOISE_N = 0.01, 5e-5, 0.02
SOFTENING = FoamSoftening(excess=0.4, kept=0.0, presses=0.05, rejoin=0.4)
HYSTERESIS = FoamHysteresis(loss=0.1, reversal=0.6, driven_by="sinking")
RELAXATION = ViscoelasticFoam(fraction=0.2, time_s=8.0, remembers_air=True)


def made_up(*effects: FoamEffect, cycles: int = 6, seed: int = 0) -> Coupon:
    """Cycles of 4 s to a strain of 0.55, then a ramp of 8 s and a hold of 12 s; a foam with a plateau (Ogden-Hill)."""
    corner_s = np.concatenate([2.0 * np.arange(2 * cycles + 1), 4.0 * cycles + np.array([8.0, 20.0])])
    corner = np.concatenate([np.tile([0.0, 0.55], cycles), [0.0, 0.55, 0.55]])
    time_s = np.arange(0, corner_s[-1], 0.08)
    strain = np.interp(time_s, corner_s, corner)
    stretch = 1 - strain
    elastic_n = AREA_M2 * (1.2e5 * np.tanh(8 * strain) * 0.3 + 4e3 * (stretch**-4 - 1))
    turns = np.searchsorted(corner_s[2::2], time_s, side="right") + 1
    count = len(time_s)
    strokes = Strokes(
        strain * HEIGHT_M,
        strain * HEIGHT_M,
        time_s,
        np.ones(count, dtype=bool),
        np.zeros(count, dtype=np.intp),
        np.minimum(turns, cycles + 1),
        HEIGHT_M,
    )
    force_n = elastic_n
    for effect in sorted(effects, key=lambda e: e.order):
        force_n = effect.reaction_n(force_n, strokes)
    force_n = force_n + NOISE_N * np.random.default_rng(seed).standard_normal(count)
    return Coupon(time_s, HEIGHT_M * stretch, force_n, HEIGHT_M, AREA_M2, "free", 0.08)


def test_cycles_and_the_slow_part_are_found():
    test = prepared(made_up())
    assert test.cycle.max() == 7
    slow = test.time_s[~test.fast]
    assert slow[0] == pytest.approx(24.0, abs=0.2)
    assert slow[-1] == test.time_s[-1]


def test_plates_that_have_left_the_foam_test_nothing():
    coupon = made_up()
    time_s = np.concatenate([coupon.time_s, coupon.time_s[-1] + 0.08 * np.arange(1, 400)])
    air = np.zeros(399)
    lifted = replace(
        coupon,
        time_s=time_s,
        gap_m=np.append(coupon.gap_m, HEIGHT_M + air),
        force_n=np.append(coupon.force_n, air),
    )
    assert prepared(lifted).time_s[-1] == pytest.approx(coupon.time_s[-1], abs=0.1)


def test_plates_that_stood_still_are_known_from_where_they_went_on():
    """The gap's record keeps the value before a halt; the next update says where they halted."""
    at_s, to_m = plates_way(np.arange(20.0), np.array([0, 1, 2, 3, 4, 5, 5, 5, 5, 5, 5, 6, 5, 4, 3, 2, 1, 0, 0, 0.0]))
    assert np.interp(8.0, at_s, to_m) == 6.0
    assert np.interp(2.5, at_s, to_m) == 2.5


def test_the_effects_put_in_are_named_with_their_parameters():
    coupon = made_up(SOFTENING, HYSTERESIS, RELAXATION)
    diagnosis = diagnose_coupon(coupon, "made up").diagnosis
    found = {claim.effect.name: claim for claim in diagnosis.claims}
    assert set(found) == {"foam_softening", "foam_hysteresis", "viscoelastic_foam"}
    held = diagnosis.held_out
    assert held.force_after_n is not None
    assert held.force_before_n is not None
    assert held.force_after_n < 0.2 * held.force_before_n
    for true in (SOFTENING, HYSTERESIS, RELAXATION):
        for key, estimate in found[true.name].parameters.items():
            assert estimate.low < estimate.high
            assert estimate.value == pytest.approx(getattr(true, key), rel=0.3)


def test_softening_alone_is_named_alone():
    diagnosis = diagnose_coupon(made_up(SOFTENING), "made up").diagnosis
    assert [claim.effect.name for claim in diagnosis.claims] == ["foam_softening"]


def test_an_elastic_foam_lacks_nothing():
    diagnosis = diagnose_coupon(made_up(), "made up").diagnosis
    assert diagnosis.verdict == "no_mismatch"
    assert diagnosis.claims == ()


def test_too_few_cycles_are_said_so():
    diagnosis = diagnose_coupon(made_up(RELAXATION, cycles=1), "made up").diagnosis
    assert diagnosis.verdict == "cannot_tell"
    assert diagnosis.reason is not None


def test_readings_that_are_no_numbers_are_left_out_and_the_report_shows_the_rest(tmp_path: Path):
    coupon = made_up(RELAXATION)
    force_n = coupon.force_n.copy()
    force_n[100:110] = np.nan
    findings = diagnose_coupon(replace(coupon, force_n=force_n), "made up")
    assert [claim.effect.name for claim in findings.diagnosis.claims] == ["viscoelastic_foam"]
    text = write_report(tmp_path, findings, write_figures(tmp_path, findings)).read_text(encoding="utf-8")
    assert "The compression test" in text
    assert "data:image/png" in text


def test_real_foam_is_predicted_better_than_by_elasticity(shared_data: Path):
    from ertskin.hardware.recording import read_recording

    coupon = read_recording(shared_data / "real" / "foam_turbo_free_2.h5").coupon
    assert coupon is not None
    test = prepared(coupon)
    fitted, out, _ = regimes(test)
    elastic = rmse_n(elastic_model([test], [fitted]), test, out)
    assert rmse_n(fit_coupon([test], [fitted], FORM, HELD), test, out) < 0.5 * elastic
