"""Load cell and readings together: what both show is as likely as the two make it.

A stage that moves while it is scanned changes the mean force much as relaxing foam does. It changes the readings too,
which foam doesn't, though perhaps by far less than a name must gain by readings alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.force.fit import ForceData, ForceFit, fit_force, force_starts
from ertskin.diagnosis.linear.calibration_vector import SkinFamily
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline, force_fits
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.form_error import form_error
from ertskin.diagnosis.search.gain import gained
from ertskin.physics.effects.effect import Effect, FoamEffect, shown_by
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.registry import effects_shown_by

Cells = Sequence[Sequence[int]]


def agreed(
    evidence: Evidence, baseline: Baseline, selection: Selection, resolution: str, partitions: Cells
) -> tuple[Baseline, Selection]:
    """The effects of the force chosen again where the readings have a say in them, and the selection beside these.

    An effect that the readings show significantly, but not so that it was chosen by them, and that is then one of the
    force's is fitted to both. One that they have chosen counts for what they gain with it: what forces alone made of
    its part of them may be other foam.
    """
    data, best = baseline.force_data, baseline.force_best
    if data is None or best is None or not best.effects:
        return baseline, selection
    chosen = {one.term.name for one in selection.chosen}
    gains = {one.term.name: one.loss for one in selection.chosen if one.term.name in force_starts()}
    seen: list[Effect] = []
    for kind in effects_shown_by(Signal.FORCE):
        undecided = kind.name not in chosen and shown_by(kind, Signal.READINGS)
        likely = _likely(data, best, kind.name, evidence) if undecided else None
        if likely is None:
            continue
        gain, effect = _in_readings(evidence, selection, likely, partitions)
        gains[kind.name] = max(gain, 0.0)
        if gain >= evidence.criteria.significant_gain:
            seen.append(effect)
    if not any(gains.values()):
        return baseline, selection
    data = replace(data, in_readings=gains)
    linear, again = force_fits(data, evidence, best.terms)
    names = {effect.name for effect in again.effects}
    joining = [effect for effect in seen if effect.name in names]
    baseline = replace(baseline, force_linear=linear, force_best=again, force_data=data)
    if not joining and {effect.name for effect in best.foam} == {effect.name for effect in again.foam}:
        return baseline, selection
    others = [effect for effect in baseline.skin.effects if not isinstance(effect, FoamEffect)]
    skin = replace(baseline.skin, pad_n_per_m=again.pad_n_per_m, effects=(*again.foam, *joining, *others))
    return replace(baseline, skin=skin), _refitted_with(
        selection, SkinFamily(skin, resolution), (*again.foam, *joining)
    )


def _likely(data: ForceData, best: ForceFit, name: str, evidence: Evidence) -> Effect | None:
    """The named effect as the forces' likeliest fit with it has it, in another's stead or beside them; None where it is
    surely less likely than those without."""
    present = [effect for effect in best.effects if effect.name == name]
    if present:
        return present[0]
    sets = [best.terms, *(tuple(o for o in best.terms if o is not term) for term in best.terms)]
    fits = [fit_force(data, [*rest, start], start=best) for rest in sets for start in force_starts()[name]]
    likeliest = min(fits, key=lambda fit: fit.information)
    surely = likeliest.information - best.information > evidence.criteria.significant_gain
    return None if surely else likeliest.effects[-1]


def _in_readings(evidence: Evidence, selection: Selection, likely: Effect, partitions: Cells) -> tuple[float, Effect]:
    """What the readings gain with an effect, begun as ``likely`` by the forces, in half chi-square, and the effect as
    they have it.

    Held out, beyond the form error of the effects at hand; of an effect that no network shows no more than what no
    network explains gains: the rest may mend the forces that drive the skin.
    """
    problem, current = selection.problem, selection.after
    if not likely.reading_starts(evidence.sensor, evidence.protocol):
        return 0.0, likely
    nonreciprocal = shown_by(likely, Signal.NONRECIPROCAL)
    without = problem.solve(current.terms, current.calibration, steps=1, leftover=nonreciprocal)
    left = form_error(problem, without, partitions, current.effects).gain
    term = Term(likely.within_scans(evidence.protocol), likely.hypothesis.also_in_readings)
    present = problem.solve([*current.terms, term], current.calibration, leftover=nonreciprocal)
    mended = form_error(problem, present, partitions, current.effects).gain - left
    gain = gained(without, present, partitions, evidence.criteria) + mended
    if nonreciprocal:
        gain = min(gain, _beyond_networks(problem, without) - _beyond_networks(problem, present))
    return gain, present.effects[-1]


def _beyond_networks(problem: VoltageProblem, solved: Solved) -> float:
    """Half chi-square of what no network explains, of the frames in which a fit is held to it."""
    residual = problem.acquisition.residual(problem.family.skin(solved.calibration, solved.effects))
    return 0.5 * float(np.square(residual).sum())


def _refitted_with(selection: Selection, family: SkinFamily, effects: Sequence[Effect]) -> Selection:
    """The selection's terms fitted beside these ``effects`` of the force instead of those before."""
    after, problem = selection.after, replace(selection.problem, family=family)
    count = len(after.terms) - len(selection.chosen)
    kept = [term for term in after.terms[:count] if not isinstance(term.effect, FoamEffect)]
    terms = [Term(e, e.hypothesis.also_in_readings) for e in effects]
    terms += [*kept, *after.terms[count:]]
    solved = problem.solve(terms, after.calibration, leftover=after.leftover)
    return replace(selection, after=solved, problem=problem)
