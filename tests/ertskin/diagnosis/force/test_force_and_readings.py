"""A motion of the stage that the load cell takes for relaxing foam is told by the readings, which foam leaves alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from small_problem import PARTITIONS, SCAN, START, recorded

from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.force.agreement import agreed
from ertskin.diagnosis.force.fit import ForceData, fit_force
from ertskin.diagnosis.force.noise import ForceNoise
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Chosen, Selection
from ertskin.physics.effects.effect import FoamEffect, MotionEffect
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam

MOVING = ScanSkew(2e-5, by_steps=True)
RELAXING = ViscoelasticFoam(fraction=0.05, time_s=3.0)
PAD_N_PER_M, SUPPORT_N_PER_M, FORCE_NOISE_N = 1800.0, 9000.0, 0.01


def case(
    in_force: FoamEffect | MotionEffect, *in_readings: MotionEffect, foam: Sequence[FoamEffect] = ()
) -> tuple[Baseline, Selection]:
    """Forces made with one effect, on ``foam``, and read as relaxing foam, readings with another, and a search that
    found nothing in these."""
    problem = recorded(*in_readings)
    history = problem.evidence.history
    data = ForceData(history, FORCE_NOISE_N, SUPPORT_N_PER_M, 1e-3, 4e-3, SCAN.duration_s)
    noise = FORCE_NOISE_N * np.random.default_rng(1).standard_normal(history.depth_m.shape)
    forces = data.force_n(PAD_N_PER_M, SUPPORT_N_PER_M, [in_force, *foam]) + noise
    data = replace(data, history=replace(history, force_n=np.where(history.touched, forces, np.nan)))
    best = fit_force(data, ViscoelasticFoam.force_starts()[:1])
    solved = problem.solve([], START)
    skin = replace(problem.family.first, effects=best.foam)
    baseline = Baseline(
        skin=skin, force_linear=fit_force(data, ()), force_best=best, force_noise=ForceNoise(FORCE_NOISE_N, 100),
        force_data=data, force_n=forces, specimen=None, specimen_findings=(), displaced=None,  # type: ignore[arg-type]
        noise=None, settling=frozenset(), traces=np.zeros(0), warmth=None,  # type: ignore[arg-type]
    )  # fmt: skip
    return baseline, Selection(solved, solved, (), problem, ())


def named(baseline: Baseline, selection: Selection) -> tuple[list[str], Selection]:
    evidence = selection.problem.evidence
    assert baseline.force_data is not None
    evidence = replace(evidence, history=baseline.force_data.history)
    baseline, selection = agreed(evidence, baseline, selection, "fast", PARTITIONS)
    assert baseline.force_best is not None
    return [effect.name for effect in baseline.force_best.effects], selection


def test_readings_tell_a_motion_from_foam_where_the_load_cell_does_not() -> None:
    names, selection = named(*case(MOVING, MOVING.within_scans(SCAN)))
    assert names == ["scan_skew"]
    assert [term.name for term in selection.after.terms] == ["scan_skew"]
    fitted = selection.after.effects[0].value("speed_m_per_s")
    error = selection.after.known(0, "speed_m_per_s")[1]
    assert fitted == pytest.approx(MOVING.speed_m_per_s, abs=4 * error)
    assert error < 0.25 * fitted


def test_what_mends_the_forces_that_drive_the_skin_is_no_motion() -> None:
    """Readings of depths that are late by a little the whole scan through, as where foam pushes back less."""
    names, selection = named(*case(RELAXING, replace(MOVING, speed_m_per_s=2e-6, at_s=4.0)))
    assert names == ["viscoelastic_foam"]
    assert "scan_skew" not in [term.name for term in selection.after.terms]


def test_foam_stays_where_readings_show_no_motion() -> None:
    names, selection = named(*case(RELAXING))
    assert names == ["viscoelastic_foam"]
    assert "scan_skew" not in [term.name for term in selection.after.terms]


def test_foam_is_chosen_again_beside_a_motion_that_readings_have_chosen() -> None:
    """Forces alone make relaxation of a stage that moves, and of foam that stiffens whatever that leaves."""
    stiffens = NonlinearFoam(stiffening=0.3)
    baseline, selection = case(MOVING, MOVING.within_scans(SCAN), foam=[stiffens])
    motion = Term(MOVING.within_scans(SCAN), ("speed_m_per_s",))
    solved = selection.problem.solve([motion], START)
    chosen = (Chosen(solved.terms[0], 1000.0, 2.0, ()),)
    names, found = named(baseline, replace(selection, after=solved, chosen=chosen))
    assert sorted(names) == ["nonlinear_foam", "scan_skew"]
    assert [term.name for term in found.after.terms] == ["nonlinear_foam", "scan_skew"]
    assert len(found.chosen) == 1
