"""A specimen alone: what its first presses show of the fabric, and how well that predicts the last.

The law's shape is free: it is the specimen's calibration. What is named is memory: hysteresis, creep, or both, when
presses that no fit has seen are predicted better with it. Presses that differ from one another are said to: then memory
is judged with each press felt as strongly as its own rise tells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, HeldOut, against, estimate, verdict_of
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.judge.quantities import Spread, stated
from ertskin.diagnosis.judge.result import Findings, refused
from ertskin.diagnosis.specimen.fit import SpecimenFinding, specimen_findings
from ertskin.diagnosis.specimen.logarithmic import LogarithmicTest
from ertskin.diagnosis.specimen.presses import Presses, presses
from ertskin.diagnosis.specimen.spread import spreads_of
from ertskin.hardware.measurement import Specimen
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.standard import Standard
from ertskin.physics.spikes import noise_on_course

FITTED = 5 / 8
"""Part of the presses that are fitted, ten of sixteen; the others are held out."""
FEWEST_PRESSES = 3
FEWEST_READINGS = 30
LEAST_SPAN = 1.5
"""Largest over smallest resistance from which a law can be fitted."""
BETTER = 1.1
"""Presses held out must be predicted so many times better for memory to be named."""
MOST_READINGS = 1500
"""Readings that a fit is given, evenly chosen; more of a smooth press say the same."""
SPLIT = "the last presses, fitted on the first five eighths of them"
SPLIT_RISEN = f"{SPLIT}; of each, what follows the rise that tells how strongly it is felt"


def diagnose_specimen(specimen: Specimen, name: str, criteria: Criteria = DEFAULT) -> Findings:
    """Which memory a specimen's first presses show, and how well the last ones are predicted with it and without."""
    reason = _unusable(specimen)
    if reason:
        return refused(name, reason)
    test, press = _thinned(specimen)
    noise = noise_on_course(np.log(np.asarray(specimen.sheet_resistance_ohm_sq, dtype=float)))
    each = presses(test, press, criteria)
    judged, rows = (each.scaled, each.ahead) if each.differ else (test, ~test.fitted)
    found, _ = specimen_findings(judged, criteria)
    effects = [finding.effect for finding in found]
    static = _ahead(judged, (), rows)
    kinds = {effect.name: _ahead(judged, (effect,), rows) for effect in effects}
    together = _ahead(judged, effects, rows) if effects else static
    needed = [f for f in found if _ahead(judged, [e for e in effects if e is not f.effect], rows) > BETTER * together]
    left = _ahead(judged, [f.effect for f in needed], rows) if needed else static
    spreads = spreads_of(judged, needed, press)
    claims = tuple(
        _claim(judged, f, spread, (kinds[f.effect.name] / noise, static / max(left, 1e-12)), criteria)
        for f, spread in zip(needed, spreads, strict=True)
    )
    errors = {"static": static, **kinds, "together": together, "noise": noise}
    before = (each.alike if each.differ else static) / noise
    after = left / noise if claims else before
    verdict = verdict_of(before, after, bool(claims), criteria)
    return Findings(_answer(name, verdict, each, errors, (before, after), claims))


def _answer(
    name: str,
    verdict: str,
    each: Presses,
    errors: dict[str, float],
    ratios: tuple[float, float],
    claims: tuple[Claim, ...],
) -> Diagnosis:
    """The diagnosis from the relative ``errors`` held out, over noise ``ratios`` before the claims and after."""
    before, after = ratios
    axes = (*(("press",) if each.differ else ()), *(("history",) if claims or not each.differ else ()))
    return Diagnosis(
        name,
        verdict,
        HeldOut(SPLIT_RISEN if each.differ else SPLIT, None, before, after, None),
        stage="piezoresistance" if before > 1 else None,
        depends_on=axes if before > 1 else (),
        claims=claims,
        unexplained_ratio=after,
        unexplained_depends_on=axes if after > 1 else (),
        reason=_reason(errors, each, bool(claims)),
        extra={"specimen_held_out": errors, "presses": each.as_builtins()},
    )


def _unusable(specimen: Specimen) -> str | None:
    """Why a specimen can't say anything, if so."""
    presses, readings = len(np.unique(specimen.cycle)), len(specimen.stress_pa)
    resistance = specimen.sheet_resistance_ohm_sq
    if presses < FEWEST_PRESSES:
        return f"{presses} presses of the specimen: to hold any out takes {FEWEST_PRESSES} or more"
    if readings < FEWEST_READINGS:
        return f"{readings} readings of the specimen: a law and its memory need at least {FEWEST_READINGS}"
    if not np.ptp(specimen.stress_pa) > 0:
        return "the specimen's stress never changes"
    if not float(resistance.max() / resistance.min()) > LEAST_SPAN:
        return f"the specimen's resistance changes by less than {100 * (LEAST_SPAN - 1):.0f} %: no law can be told"
    if (np.diff(specimen.time_s) <= 0).mean() > 0.5:
        return "the specimen's clock stands still: creep can't be told from hysteresis"
    return None


def _thinned(specimen: Specimen) -> tuple[LogarithmicTest, NDArray[np.intp]]:
    """The test with no more readings than a fit needs, to be fitted on its first presses; and each reading's press."""
    step = max(1, len(specimen.stress_pa) // MOST_READINGS)
    order = np.argsort(specimen.time_s, kind="stable")[::step]
    cycles = np.unique(specimen.cycle)
    last = cycles[max(1, round(FITTED * len(cycles))) - 1]
    stress = np.maximum(np.asarray(specimen.stress_pa, dtype=float)[order], 0.0)
    resistance = np.asarray(specimen.sheet_resistance_ohm_sq, dtype=float)[order]
    press = np.asarray(specimen.cycle)[order]
    return LogarithmicTest(stress, resistance, specimen.time_s[order], press <= last), press


def _ahead(test: LogarithmicTest, effects: Sequence[PiezoEffect], rows: NDArray[np.bool_]) -> float:
    """Relative rms error on ``rows`` (N,), with these effects and the law of the first presses."""
    return float(np.sqrt(np.mean(test.errors(effects)[rows] ** 2)))


def _claim(
    test: LogarithmicTest, finding: SpecimenFinding, spread: Spread, sizes: tuple[float, float], criteria: Criteria
) -> Claim:
    """``sizes``: the misfit over noise with the effect alone, and how many times better the claims predict."""
    ratio, gain = sizes
    confidence, alternatives = against(finding.rivals, criteria)
    known = finding.effect.parameters()
    estimates = {
        key: estimate(float(getattr(finding.effect, key)), float(error), known[key])
        for key, error in zip(spread.free, spread.error, strict=True)
    }
    law = test.law((finding.effect,))
    standard = Standard(lambda pressure_pa: np.exp(law(pressure_pa)), float(test.stress_pa.max()))
    # What presses held out hardly ask for is no sure name.
    claim = Claim(finding.effect, confidence * (1 - 1 / gain), ratio, estimates, alternatives)
    return stated(claim, standard, spread)


def _reason(errors: dict[str, float], each: Presses, named: bool) -> str:
    kinds = {kind: error for kind, error in errors.items() if kind not in ("static", "together", "noise")}
    tried = "".join(f", {kind} {100 * error:.2g} %" for kind, error in kinds.items())
    both = f", all of these {100 * errors['together']:.2g} %" if len(kinds) > 1 else ""
    static, noise = 100 * errors["static"], 100 * errors["noise"]
    differ = ""
    if each.differ:
        differ = (
            f"presses differ: each is felt more or less strongly, by a factor of {np.exp(each.spread):.2g} (rms), as "
            "presses of other places are, or contacts made anew; a static law for all alike errs by "
            f"{100 * each.alike:.2g} % after their rise; with each press's own factor, told by its rise: "
        )
    said = f"{differ}held out, a static law errs by {static:.2g} %{tried}{both}; a reading's noise is {noise:.2g} %"
    return said if named else f"{said}; no memory predicts presses held out better"
