"""A specimen alone: what its first presses show of the fabric, and how well that predicts the last.

The law's shape is free: it is the specimen's calibration. What is named is memory: hysteresis, creep, or both, when
presses that no fit has seen are predicted better with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, Estimate, HeldOut, confidences, verdict_of
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.specimen.fit import SpecimenFinding, SpecimenTest, specimen_findings
from ertskin.hardware.measurement import Specimen
from ertskin.physics.effects.effect import PiezoEffect
from ertskin.physics.effects.piezo_chain import felt

Array = NDArray[np.float64]

LAW_ORDER = 7
SMALLEST = 1e-3
"""Pressure over the largest, below which a specimen lies in the air."""
FITTED = 5 / 8
"""Part of the presses that are fitted, ten of sixteen; the others are held out."""
FEWEST_PRESSES = 3
FEWEST_READINGS = 30
LEAST_SPAN = 1.5
"""Largest over smallest resistance from which a law can be told."""
BETTER = 1.1
"""Presses held out must be predicted so many times better for memory to be named."""
MOST_READINGS = 1500
"""Readings that a fit is given, evenly chosen; more of a smooth press say the same."""
SPLIT = "the last presses, fitted on the first five eighths of them"


@dataclass(frozen=True, eq=False)
class LogarithmicTest(SpecimenTest):
    """A test whose resistance spans decades: the law's logarithm is free in the pressure's, from ``SMALLEST`` on.

    ``fitted`` (N,): the readings that the law is fitted to.
    """

    fitted: NDArray[np.bool_]

    def errors(self, effects: Sequence[PiezoEffect]) -> Array:
        """(N,) relative errors of all readings with these effects."""
        pressure, factor = felt(effects, self.stress_pa[:, None], np.zeros((1, 2)), self.time_s, np.zeros((2, 2)))
        coordinate = np.log1p(np.maximum(pressure[:, 0], 0.0) / (SMALLEST * self.stress_pa.max()))
        design = chebyshev.chebvander(2 * coordinate / coordinate.max() - 1, LAW_ORDER)
        target = np.log(self.resistance_ohm_sq) - np.log(np.ravel(factor))
        law = np.linalg.lstsq(design[self.fitted], target[self.fitted], rcond=None)[0]
        return np.asarray(design @ law - target)

    def residual(self, effects: Sequence[PiezoEffect]) -> Array:
        """(n,) those of the readings fitted."""
        return self.errors(effects)[self.fitted]


def diagnose_specimen(specimen: Specimen, name: str) -> Findings:
    """Which memory a specimen's first presses show, and how well the last ones are predicted with it and without."""
    reason = _unusable(specimen)
    if reason:
        held = HeldOut("none", None, None, None, None)
        return Findings(Diagnosis(name, "cannot_tell", held, reason=reason))
    test = _thinned(specimen)
    noise = _noise(specimen.sheet_resistance_ohm_sq)
    found, _ = specimen_findings(test)
    effects = [finding.effect for finding in found]
    static = _ahead(test, ())
    kinds = {effect.name: _ahead(test, (effect,)) for effect in effects}
    together = _ahead(test, effects) if effects else static
    needed = [f for f in found if _ahead(test, [e for e in effects if e is not f.effect]) > BETTER * together]
    before, after = static / noise, (_ahead(test, [f.effect for f in needed]) if needed else static) / noise
    claims = tuple(_claim(f, kinds[f.effect.name] / noise, before / max(after, 1e-12)) for f in needed)
    return Findings(
        Diagnosis(
            name,
            verdict_of(before, after, bool(claims), other_mismatch=False),
            HeldOut(SPLIT, None, before, after, None),
            stage="piezoresistance" if before > 1 else None,
            depends_on=("history",) if before > 1 else (),
            claims=claims,
            unexplained_ratio=after,
            unexplained_depends_on=("history",) if after > 1 else (),
            reason=_reason(static, kinds, together, noise, bool(claims)),
            extra={"specimen_held_out": {"static": static, **kinds, "together": together, "noise": noise}},
        )
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


def _thinned(specimen: Specimen) -> LogarithmicTest:
    """The test with no more readings than a fit needs, to be fitted on its first presses."""
    step = max(1, len(specimen.stress_pa) // MOST_READINGS)
    order = np.argsort(specimen.time_s, kind="stable")[::step]
    cycles = np.unique(specimen.cycle)
    last = cycles[max(1, round(FITTED * len(cycles))) - 1]
    stress = np.maximum(np.asarray(specimen.stress_pa, dtype=float)[order], 0.0)
    resistance = np.asarray(specimen.sheet_resistance_ohm_sq, dtype=float)[order]
    return LogarithmicTest(stress, resistance, specimen.time_s[order], specimen.cycle[order] <= last)


def _ahead(test: LogarithmicTest, effects: Sequence[PiezoEffect]) -> float:
    """Relative rms error on the presses held out, with these effects and the law of the first presses."""
    return float(np.sqrt(np.mean(test.errors(effects)[~test.fitted] ** 2)))


def _noise(resistance: Array) -> float:
    """Relative noise of a reading, from third differences of its logarithm."""
    jump = np.diff(np.log(np.asarray(resistance, dtype=float)), 3)
    return float(max(1.4826 * np.median(np.abs(jump)) / np.sqrt(20.0), 1e-4))


def _claim(finding: SpecimenFinding, ratio: float, gain: float) -> Claim:
    shares = [(rival.effect.name, rival.short) for rival in finding.rivals]
    confidence, alternatives = confidences(tuple(shares))
    known = finding.effect.parameters()
    values = finding.effect.values()
    estimates: dict[str, Any] = {
        key: Estimate(values[key], values[key], values[key], known[key].unit) for key in finding.free if key in values
    }
    # What presses held out hardly ask for is no sure name.
    return Claim(finding.effect, confidence * (1 - 1 / gain), ratio, estimates, alternatives)


def _reason(static: float, kinds: dict[str, float], together: float, noise: float, named: bool) -> str:
    tried = "".join(f", {kind} {100 * error:.2g} %" for kind, error in kinds.items())
    both = f", all of these {100 * together:.2g} %" if len(kinds) > 1 else ""
    said = f"held out, a static law errs by {100 * static:.2g} %{tried}{both}; a reading's noise is {100 * noise:.2g} %"
    return said if named else f"{said}; no memory predicts presses held out better"
