"""Rivals of the diagnosis on a small skin: what is hidden they find, where nothing is they say nothing."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "concealed"))
sys.path.insert(0, str(Path(__file__).parents[1] / "ertskin"))

import nameless_discrepancy
import rivals
from dictionary import Atom, Dictionary, dictionaries
from distortion_tests import by_distortion_tests, outcomes, significant
from matching_pursuit import by_matching_pursuit, error_without
from nameless_discrepancy import by_nothing, nameless
from selectors_of_effects import _akaike_weight
from small_skin import FOUR_PRESSES, SMALL, four_presses, small_law, small_sensor

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, HeldOut
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.judge.answer import _as_chosen
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, Start
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

PADS, NOISE_V = 6, 1e-5
SCAN = Protocol.against_sink(electrode_pairs(PADS), PADS, 1e-4)
CONTACT_OHM = np.linspace(200.0, 900.0, PADS)
START = Calibration(9000.0, CONTACT_OHM, 0.0, np.zeros(SHAPE))
PARTITIONS = [[k] for k in range(FOUR_PRESSES)]
TILTED = SheetAnisotropy(stretch_diagonal=0.02)
LOUD = ChannelGain(channel=2, gain=3e-3)


def silent(share: float | None, text: str) -> None:
    """Reports nothing."""


@cache
def problem_of(*hidden: Effect) -> VoltageProblem:
    """The fit of a small skin's readings, in which these effects are hidden."""
    skin = Skin.build(small_sensor(), SCAN, small_law(), CONTACT_OHM, 9000.0, (), SMALL)
    seen = four_presses()
    linear = LinearSkin(skin, seen, np.nan_to_num(skin.force_n(seen)), np.arange(len(seen)), None)
    basis = SCAN.orthonormal
    skins = replace(skin, effects=tuple(e for e in hidden if not isinstance(e, AcquisitionEffect)))
    readings = (linear.scans(skins) @ basis.T).reshape(-1, *SCAN.shape)
    for effect in hidden:
        if isinstance(effect, AcquisitionEffect):
            readings = effect.distorted_v(readings, SCAN)
    readings = readings + NOISE_V * np.random.default_rng(0).standard_normal(readings.shape)
    flat = readings.reshape(len(seen), -1)
    scan = flat @ basis
    evidence = Evidence(
        skin.sensor, SCAN, seen, scan, (flat - scan @ basis.T).reshape(readings.shape).astype(np.float32), NOISE_V,
        NOISE_V, float("nan"), None, np.zeros((scan.shape[1], 0)), np.zeros((*scan.shape, 0)),
        1 - scan.shape[1] / flat.shape[1], np.zeros(PADS, dtype=np.intp),
    )  # fmt: skip
    return VoltageProblem(evidence, SkinFamily(skin, "fast"), linear, None, seen.press, np.ones(len(seen)))


@pytest.fixture(autouse=True)
def linearised_is_the_skin(monkeypatch: pytest.MonkeyPatch) -> None:
    """The readings are the linearised skin's own: there is no other to settle to."""
    for module in ("matching_pursuit", "distortion_tests"):
        monkeypatch.setattr(
            f"{module}.settled", lambda build, solved: SimpleNamespace(problem=build(None), solved=solved)
        )
        monkeypatch.setattr(f"{module}.exact", lambda problem, solved: (problem, solved))
    monkeypatch.setattr(SkinFamily, "remeshed", lambda family, calibration, effects: family.skin(calibration, effects))


def chosen_by(selector: Any, *hidden: Effect) -> dict[str, float]:
    """The names that a selector chooses, with its confidence, the first chosen first."""
    selection = selector(lambda solved: problem_of(*hidden), (), (), START, PARTITIONS, silent)
    names = [one.term.name for one in selection.chosen]
    assert [term.name for term in selection.after.terms] == names
    return dict(zip(names, (one.confidence for one in selection.chosen), strict=True))


def atom_of(found: Dictionary, kind: type[Effect]) -> int:
    return next(k for k, atom in enumerate(found.atoms) if isinstance(atom.effect, kind))


# dictionary


def test_what_an_atom_takes_off_is_what_the_joint_fit_gains() -> None:
    problem = problem_of(TILTED)
    uncorrected = problem.solve((), START)
    found, _ = dictionaries(problem, uncorrected)
    number = atom_of(found, SheetAnisotropy)
    with_it = problem.solve([found.atoms[number].term(found.amount(number))], uncorrected.calibration)
    fall = found.falls(found.reduced_gradient[None])[0][0, number]
    assert fall == pytest.approx(2 * (uncorrected.cost - with_it.cost), rel=0.05)
    assert found.amount(number)[1] == pytest.approx(TILTED.stretch_diagonal, rel=0.1)


def test_what_the_calibration_explains_too_no_atom_is_credited_with() -> None:
    problem = problem_of(TILTED)
    found, _ = dictionaries(problem, problem.solve((), START))
    number = atom_of(found, SheetAnisotropy)
    onto = found.atoms[number].onto
    raw, reduced = (np.diag(onto.T @ gram @ onto) for gram in (found.gram, found.reduced_gram))
    assert (reduced < raw).all()
    assert (reduced > 0).all()


def test_effects_in_the_fit_are_no_atoms() -> None:
    problem = problem_of(TILTED)
    uncorrected = problem.solve((), START)
    found, _ = dictionaries(problem, uncorrected)
    number = atom_of(found, SheetAnisotropy)
    corrected = problem.solve([found.atoms[number].term(found.amount(number))], uncorrected.calibration)
    names = {atom.effect.name for one in dictionaries(problem, corrected) for atom in one.atoms}
    assert SheetAnisotropy.name not in names
    assert {PiezoHysteresis.name, ChannelGain.name} <= names


def test_the_instrument_shows_in_what_no_network_explains() -> None:
    problem = problem_of(LOUD)
    scans, leftover = dictionaries(problem, problem.solve((), START))
    assert not any(isinstance(atom.effect, ChannelGain) for atom in scans.atoms)
    number = int(leftover.falls(leftover.reduced_gradient[None])[0].argmax())
    best = leftover.atoms[number].effect
    assert isinstance(best, ChannelGain)
    assert best.channel == LOUD.channel
    assert leftover.amount(number)[0] == pytest.approx(LOUD.gain, rel=0.1)


# distortion tests


def of_columns(columns: np.ndarray, wrong: np.ndarray) -> Dictionary:
    """One start for every column (N,B), beside a residual (N,)."""
    kinds = (SheetAnisotropy, TemperatureDrift, PiezoHysteresis)
    atoms = tuple(
        Atom(
            Start(kinds[k % 3](), (), (next(iter(kinds[k % 3].parameters())),)), np.eye(columns.shape[1])[:, k : k + 1]
        )
        for k in range(columns.shape[1])
    )
    gradient, gram = columns.T @ wrong, columns.T @ columns
    return Dictionary(atoms, gram, gradient, gram)


def test_the_least_p_value_of_many_tests_is_what_it_says() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(200, 60)) @ rng.normal(size=(60, 60))
    least = [min(t.p_value for t in outcomes([of_columns(columns, rng.normal(size=200))], 99)) for _ in range(120)]
    assert 0.3 < np.mean(least) < 0.7
    assert np.mean(np.array(least) <= 0.1) < 0.2


def test_of_each_name_the_likeliest_distortion_is_named() -> None:
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(500, 9))
    found = outcomes([of_columns(columns, rng.normal(size=500) + 0.5 * columns[:, 4] + 0.3 * columns[:, 3])], 200)
    named = significant(found, 0.01)
    assert [one.atom.effect.name for one in named] == [TemperatureDrift.name, SheetAnisotropy.name]
    assert named[0].amount[0] == pytest.approx(0.5, abs=0.15)


def test_distortion_tests_name_what_is_hidden_first() -> None:
    named = chosen_by(by_distortion_tests, TILTED)
    assert next(iter(named)) == SheetAnisotropy.name
    assert named[SheetAnisotropy.name] == pytest.approx(1 - 1 / 501)


def test_distortion_tests_name_nothing_of_noise() -> None:
    assert not chosen_by(by_distortion_tests)


# matching pursuit


def test_the_pursuit_begins_with_what_is_hidden() -> None:
    found = chosen_by(by_matching_pursuit, TILTED)
    assert next(iter(found)) == SheetAnisotropy.name
    assert found[SheetAnisotropy.name] == 1.0


def test_the_pursuit_is_as_long_as_predicts_best(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {0: [9.0, 9.0, 9.0, 9.0], 1: [5.0, 5.0, 5.0, 5.0], 2: [3.0, 3.0, 3.0, 6.0]}

    def error(problem: VoltageProblem, solved: Solved, out: list[int]) -> float:
        return errors.get(len(solved.terms), [8.0] * FOUR_PRESSES)[out[0]]

    monkeypatch.setattr("matching_pursuit.error_without", error)
    assert list(chosen_by(by_matching_pursuit, TILTED).values()) == [1.0, 0.75]


def test_the_pursuit_finds_the_instrument_beside_the_sheet() -> None:
    found = chosen_by(by_matching_pursuit, TILTED, LOUD)
    assert set(found) >= {SheetAnisotropy.name, ChannelGain.name}


def test_a_fold_s_error_is_of_presses_that_the_fit_has_not_seen() -> None:
    problem = problem_of(TILTED)
    uncorrected = problem.solve((), START)
    seen = float((uncorrected.scan_residual[problem.cells == 1] ** 2).sum())
    beyond = SCAN.count - SCAN.orthonormal.shape[1]
    without = error_without(problem, uncorrected, [1])
    assert without - beyond * FOUR_PRESSES > seen


# discrepancy


def test_a_discrepancy_names_nothing_and_says_what_it_predicts(monkeypatch: pytest.MonkeyPatch) -> None:
    selection = by_nothing(lambda solved: problem_of(TILTED), (), (), START, PARTITIONS, silent)
    held = np.arange(4, 8)
    residual = selection.after.scan_residual[held]
    monkeypatch.setattr(nameless_discrepancy, "remainder", lambda history, known, elsewhere: 0.5 * residual)
    said = Diagnosis("a.h5", "partly_explained", HeldOut("presses", 2e-3, 3.0, 3.0, 0.5))
    claims = (Claim(TILTED, 0.9, 1.2, {}),)
    found = nameless(Findings(replace(said, claims=claims), selection=selection, held=held, residual_after=residual))
    assert found.verdict == "unexplained"
    assert found.claims == ()
    assert found.held_out.ratio_after == pytest.approx(0.5 * np.sqrt((residual**2).mean()))
    nothing = Findings(replace(said, verdict="no_mismatch"), selection=selection, held=held, residual_after=residual)
    assert nameless(nothing).verdict == "no_mismatch"


# choosing once


def test_what_a_rival_has_chosen_is_fitted_again_not_chosen_again() -> None:
    calls = []

    def chooses(*given: Any) -> Any:
        calls.append(given)
        return by_distortion_tests(*given)

    once = rivals.Once(chooses)
    first = once(lambda solved: problem_of(TILTED), (), (), START, PARTITIONS, silent)
    less = replace(TILTED, stretch_diagonal=0.01)
    loop = Term(PiezoHysteresis(width=0.05), ("width",))
    begun = [(one.term, one.rivals) for one in first.chosen if one.term.name == TILTED.name]
    again = once(lambda solved: problem_of(less), [loop], begun, START, PARTITIONS, silent)
    assert len(calls) == 1
    assert [one.term.name for one in again.chosen] == [TILTED.name]
    assert [term.name for term in again.after.terms] == [loop.name, TILTED.name]
    tilts = [next(one.term.effect for one in found.chosen if one.term.name == TILTED.name) for found in (first, again)]
    assert [tilt.value("stretch_diagonal") for tilt in tilts] == pytest.approx([0.02, 0.01], rel=0.1)


# confidence


def test_a_rival_s_confidence_is_its_own() -> None:
    claim = Claim(TILTED, 0.2, 1.3, {})
    assert _as_chosen(claim, SimpleNamespace(confidence=0.8)).confidence == 0.8  # type: ignore[arg-type]
    field = Claim(TILTED, 0.2, 1.3, {}, name_confidence=0.7)
    assert _as_chosen(field, SimpleNamespace(confidence=0.8)).named == 0.8  # type: ignore[arg-type]
    assert _as_chosen(claim, SimpleNamespace(confidence=None)) is claim  # type: ignore[arg-type]


def test_akaike_weights_are_shares() -> None:
    def fit(cost: float, numbers: int) -> Solved:
        return SimpleNamespace(cost=cost, fit=SimpleNamespace(value=np.zeros(numbers)))  # type: ignore[return-value]

    tried = [fit(10.0, 3), fit(10.0, 4), fit(12.0, 3)]
    weights = [_akaike_weight(one, tried) for one in tried]
    assert sum(weights) == pytest.approx(1.0)
    assert weights[1] / weights[0] == pytest.approx(np.exp(-1))


# command


def test_a_rival_writes_a_diagnosis(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    said = Diagnosis("a.h5", "no_mismatch", HeldOut("presses", 2e-3, 1.0, 1.0, 0.5))
    monkeypatch.setattr(rivals, "diagnosis_by", lambda name, path: said)
    monkeypatch.setattr(sys, "argv", ["rivals.py", "omp", "a.h5", str(tmp_path / "out" / "diagnosis.json")])
    assert rivals.main() == 0
    assert '"no_mismatch"' in (tmp_path / "out" / "diagnosis.json").read_text()
    monkeypatch.setattr(sys, "argv", ["rivals.py", "omp", "a.h5", str(tmp_path / "other.json")])
    with pytest.raises(SystemExit):
        rivals.main()
