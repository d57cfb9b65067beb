"""What force and depth say by themselves: effects of foam and stage, misfits before and after, whether more is off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Claim, Estimate, Rival, against, estimate
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.force.fit import ForceData, ForceFit, fit_force, force_starts
from ertskin.diagnosis.judge.confidence import left_over_of_force
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Selection
from ertskin.physics.effects.effect import Effect, Start
from ertskin.physics.effects.hypothesis import Need
from ertskin.physics.history import History, Phase

Indices = NDArray[np.intp]

SUPPORT_SHARE = 1e-3
"""Part of the support's stiffness by which it may be off where an effect is fitted in another's stead."""
FEW_SHARE = 1 / 6
"""Part of the presses that are few: what hides in them is another thing than what is off in all."""
FELT_ERROR = 0.1
"""By how much a foam's form moves the share of its force that the sheet seems not to feel, rounded up: 44 true foams of
thirty-one opened samples and `final310` were off by 0.13 (rms), known to 0.10; 0.09 is left (`proof/felt_share.py`)."""


@dataclass(frozen=True)
class ForceAnswer:
    """Claims of effects of foam and stage; rms misfits in newton, None without forces; ``off`` where more is off.

    Then ``off_by`` is the rms misfit of all forces over the load cell's noise, ``most_off`` the fewest presses that
    hold half of what is more than noise, where they are few of all.
    """

    claims: tuple[Claim, ...]
    before_n: float | None
    after_n: float | None
    off: bool
    off_by: float = 0.0
    most_off: tuple[int, ...] = ()


def force_answer(evidence: Evidence, baseline: Baseline, selection: Selection, held: Indices) -> ForceAnswer:
    """The force stage's part of the diagnosis, judged on the frames ``held`` (n,).

    ``selection`` tells how much of the force the sheet feels.
    """
    linear, best = baseline.force_linear, baseline.force_best
    if linear is None or best is None:
        return ForceAnswer((), None, None, off=_off(evidence, baseline))
    noise = baseline.force_noise.rms_n
    before, after = (_predicted_n(evidence, baseline, fit, held) for fit in (linear, best))
    # What the readings show as well is claimed by them, who know its course.
    shown = {chosen.term.name for chosen in selection.chosen}
    terms = [term for term in best.terms if term.effect.name not in shown]
    both = baseline.shown_by_force_and_readings
    claims = [_felt(_claim(evidence.criteria, baseline, best, term), selection) for term in terms]
    claims = [replace(claim, by_force=claim.effect.name not in both) for claim in claims]
    # What the load cell would miss without it; what the readings show too needn't be material to the load cell.
    material = evidence.criteria.material_ratio
    claims = [claim for claim in claims if claim.effect.name in both or claim.ratio_alone > material]
    off = _off(evidence, baseline)
    if off:
        claims = left_over_of_force(claims, before / noise, after / noise, evidence.criteria)
    where = _where_off(evidence.history, best) if off else (0.0, ())
    return ForceAnswer(tuple(claims), before, after, off, *where)


def _where_off(history: History, fit: ForceFit) -> tuple[float, tuple[int, ...]]:
    """Rms residual, and the fewest presses that hold half of the excess of its square; none where these aren't few."""
    square = fit.residual**2
    known = np.isfinite(square).any(axis=1)
    excess = {int(p): float(np.nansum(square[history.press == p] - 1)) for p in np.unique(history.press[known])}
    largest = sorted(excess, key=lambda press: -excess[press])
    held = np.cumsum([excess[press] for press in largest])
    enough = int(np.searchsorted(held, 0.5 * sum(excess.values()))) + 1
    few = enough <= FEW_SHARE * len(excess)
    return float(np.sqrt(np.nanmean(square))), tuple(sorted(largest[:enough])) if few else ()


def _predicted_n(evidence: Evidence, baseline: Baseline, fit: ForceFit, held: Indices) -> float:
    """Rms in newton by which the fit's effects, fitted again without the presses held out, miss their forces."""
    press = evidence.history.press
    again = fit_force(_data(baseline, fit), fit.terms, ~np.isin(press, press[held]), start=fit)
    seen = again.residual[held]
    whole = seen if np.isfinite(seen).any() else fit.residual
    return float(np.sqrt(np.nanmean(whole**2)) * baseline.force_noise.rms_n)


def _data(baseline: Baseline, fit: ForceFit) -> ForceData:
    assert baseline.force_data is not None
    return replace(baseline.force_data, support_n_per_m=fit.support_n_per_m, support_error=SUPPORT_SHARE)


def _off(evidence: Evidence, baseline: Baseline) -> bool:
    """Whether force and depth disagree by more than the load cell's noise, effects and all."""
    best, noise = baseline.force_best, baseline.force_noise
    if best is None:
        return False
    known = np.isfinite(best.residual)
    misfit_n = best.residual[known] * noise.rms_n
    phase = np.broadcast_to(evidence.history.phase[:, None], known.shape)[known]
    rms_n, criteria = float(np.sqrt(np.mean(misfit_n**2))), evidence.criteria
    return noise.exceeded(rms_n, len(misfit_n), criteria) or noise.leans(misfit_n, phase, criteria)


def _felt(claim: Claim, selection: Selection) -> Claim:
    """The claim with what the readings add to it: how much of the force the sheet feels."""
    solved = selection.after
    for number, term in enumerate(solved.terms):
        if term.name == claim.effect.name and term.free:
            known = term.effect.parameters()
            told = {key: solved.known(number, key) for key in term.free}
            found = {key: estimate(*one, known[key]) for key, one in told.items()}
            misread = _misread(term.effect, told)
            return replace(claim, effect=term.effect, parameters=claim.parameters | found, misread=misread)
    return claim


def _misread(effect: Effect, told: dict[str, tuple[float, float]]) -> float | None:
    """What the readings gain, in half chi-square, where the load cell misreads and the foam doesn't give way: by values
    and errors ``told`` of the parameters that say how much of the force the sheet feels. None of what no load cell
    does, or where the readings weren't asked."""
    unfelt = {key: value for key, value in effect.misread().items() if key in told}
    lost = [_lost(*told[key], effect.known(key).neutral) - _lost(*told[key], unfelt[key]) for key in unfelt]
    return sum(lost) if lost else None


def _lost(value: float, error: float, wanted: float) -> float:
    """Half chi-square that a parameter known to an ``error`` loses at the value ``wanted``."""
    return 0.5 * (value - wanted) ** 2 / (error**2 + FELT_ERROR**2)


def _claim(criteria: Criteria, baseline: Baseline, best: ForceFit, term: Start) -> Claim:
    """The fit without this effect, and with each other effect, or none of them, in its stead."""
    data = _data(baseline, best)
    rest = [other for other in best.terms if other is not term]
    count = int(np.isfinite(best.residual).sum())
    without = fit_force(data, rest, start=best)
    alone = float(np.sqrt(max(1.0, 1 + (without.chi_square - best.chi_square) / count)))
    rivals = _rivals(data, best, rest, term)
    confidence, alternatives = against(rivals, criteria)
    return Claim(term.effect, confidence, alone, _estimates(best, term), alternatives, rivals, by_force=True)


def _rivals(data: ForceData, best: ForceFit, rest: list[Start], term: Start) -> tuple[Rival, ...]:
    used = {e.name for e in best.effects}
    rivals = []
    for name, starts in force_starts().items():
        if name in used:
            continue
        replaced = min((fit_force(data, [*rest, s], start=best) for s in starts), key=lambda f: f.information)
        short = replaced.information - best.information
        if not distinguishable(term.effect, replaced.effects[-1], data.history):
            # A better fit is that of a form, no more.
            short = min(short, 0.0)
        rivals.append(Rival(replaced.effects[-1], short))
    return tuple(rivals)


def distinguishable(one: Effect, other: Effect, history: History) -> bool:
    """Whether the presses of ``history`` can tell two effects from one another.

    Two that push back less on the way out differ only on a second way in at the same place.
    """
    return not all(Need.RELOADING in effect.hypothesis.needs for effect in (one, other)) or _reloaded(history)


def _reloaded(history: History) -> bool:
    """Whether the pad is loaded again somewhere: in another press of the same place, or within a press."""
    place = history.spot[:, 0]
    touched = history.touched[:, 0] & (place >= 0)
    presses = np.unique(np.stack([place[touched], history.press[touched]], axis=1), axis=0)
    if len(np.unique(presses[:, 0])) < len(presses):
        return True
    same = history.press[1:] == history.press[:-1]
    return bool((same & (history.phase[:-1] == Phase.UNLOADING) & (history.phase[1:] == Phase.LOADING)).any())


def _estimates(best: ForceFit, term: Start) -> dict[str, Estimate]:
    known = term.effect.parameters()
    estimates = {}
    for key in term.free:
        k = best.names.index(f"{term.effect.name}.{key}")
        error = float(np.sqrt(max(best.covariance[k, k], 0.0)))
        estimates[key] = estimate(float(getattr(term.effect, key)), error, known[key])
    return estimates
