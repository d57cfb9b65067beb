"""Where, what, how sure: the whole diagnosis of one recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Diagnosis, Rival
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.design.doubtful_claim import settling_press
from ertskin.diagnosis.fit.full_solution_check import Problem, exact, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.force.agreement import agreed
from ertskin.diagnosis.judge.answer import answered
from ertskin.diagnosis.judge.confidence import UNKNOWN_MAPS, none_is_known
from ertskin.diagnosis.judge.held_out import Predictions, predictions, ratio
from ertskin.diagnosis.judge.quantities import with_fields_of_all_presses, with_quantities
from ertskin.diagnosis.judge.remainder import remainder
from ertskin.diagnosis.judge.repeatability import Repeatability, repeatability
from ertskin.diagnosis.judge.result import Findings, refused
from ertskin.diagnosis.judge.undetermined_field import ratio_with_what_is_unknown
from ertskin.diagnosis.linear.calibration_vector import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.recording.evidence import CannotTell, Evidence, gather
from ertskin.diagnosis.recording.split import FEW, MANY, all_fitted, fitted_and_held, folds_of
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.rest.baseline import Baseline, calibrated
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.form_error import form_error
from ertskin.diagnosis.search.pressed_places import pressed_places_m
from ertskin.diagnosis.search.selection import Report, select, selected_again
from ertskin.diagnosis.search.trials import of_presses, only_presses_show, rms_of
from ertskin.diagnosis.specimen.fit import SpecimenFinding
from ertskin.hardware.recording import Recording
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Selector = Callable[..., Selection]
"""With the arguments of ``select``."""
Shown = Sequence[tuple[Term, tuple[Rival, ...]]]
"""Terms that a search begins with, and their rivals where they were shown."""

FOLDS = 6
START_RATIO = 0.0


def diagnose(
    recording: Recording,
    name: str,
    report: Report,
    resolution: str = "fine",
    selector: Selector = select,
    criteria: Criteria = DEFAULT,
) -> Findings:
    """Diagnose a skin's recording; what it can't say ends in a ``cannot_tell`` with the reason.

    ``selector`` chooses the effects.
    """
    try:
        return _diagnose(recording, name, report, resolution, selector, criteria)
    except CannotTell as error:
        reason = str(error)
    except np.linalg.LinAlgError:
        reason = "no sheet with contacts gives such readings: check wiring, injected currents and units"
    except MeshError as error:
        reason = f"the sheet can't be meshed: {error}"
    return refused(name, reason)


def _diagnose(
    recording: Recording, name: str, report: Report, resolution: str, selector: Selector, criteria: Criteria
) -> Findings:
    report(0.01, "reading the evidence")
    evidence = gather(recording, criteria)
    report(0.04, "calibrating at rest, fitting force and depth")
    baseline = calibrated(recording, evidence, resolution)
    noise = baseline.noise
    evidence = replace(
        evidence,
        noise_v=noise.rms_v,
        excess_noise=noise.excess_noise,
        traces=baseline.traces,
        seen_at_rest=baseline.warmth,
    )
    fitted, held = fitted_and_held(evidence)
    family = SkinFamily(baseline.skin, resolution)
    selection = _selected(evidence, baseline, family, fitted, selector, report)
    partitions = _partitions(folds_of(evidence.history.press[fitted], FOLDS))
    baseline, selection = agreed(evidence, baseline, selection, resolution, partitions)
    family = selection.problem.family
    uncorrected = _uncorrected(evidence, baseline, family, fitted, selection)
    report(0.85, "predicting presses no fit has seen")
    found = predictions(evidence, baseline, uncorrected, selection, family, held)
    if selection.chosen and found.ratio_after > criteria.mismatch_ratio:
        found = _counting_the_unknown(evidence, baseline, family, selection, found)
    skin = family.skin(selection.after.calibration, selection.after.effects)
    differ = _presses_that_differ(selection, skin) if found.ratio_after > criteria.mismatch_ratio else None
    findings = with_quantities(answered(name, evidence, baseline, selection, found, differ), family)
    if (findings.diagnosis.unexplained_ratio or 0.0) > criteria.mismatch_ratio:
        report(0.9, "predicting what no name explains")
        findings = _with_remainder(findings, selection, found)
    report(0.92, "looking for the press that would settle what is in doubt")
    press = settling_press(evidence, skin, baseline.force_noise.rms_n, findings.diagnosis.claims)
    findings = replace(findings, diagnosis=replace(findings.diagnosis, next_press=press))
    findings = _with_its_end(findings, evidence.work)
    return _with_maps_judged(_for_simulation(findings, evidence, baseline, family, selection, selector, report))


def _with_its_end(findings: Findings, work: Work) -> Findings:
    """The findings, which say so, once, where a search was cut short though something is missing."""
    said = "the search stopped at its limit of computing: effects it hasn't tried may explain more"
    if not work.has_ended or findings.diagnosis.verdict == "no_mismatch" or said in (findings.diagnosis.reason or ""):
        return findings
    return replace(findings, diagnosis=_saying(findings.diagnosis, said))


def _with_maps_judged(findings: Findings) -> Findings:
    """The findings, whose verdict isn't ``explained`` by fields alone of which none has a map rather right than wrong:
    those of all presses, where these were fitted."""
    diagnosis = findings.diagnosis
    if diagnosis.verdict != "explained" or not none_is_known(diagnosis.claims):
        return findings
    diagnosis = _saying(replace(diagnosis, verdict="partly_explained"), UNKNOWN_MAPS)
    return replace(findings, diagnosis=diagnosis)


def _for_simulation(
    findings: Findings,
    evidence: Evidence,
    baseline: Baseline,
    family: SkinFamily,
    selection: Selection,
    selector: Selector,
    report: Report,
) -> Findings:
    """The findings, of which what is handed on is fitted to all presses where they are few, and chosen from all of
    them, beginning with what was found, where they are very few, or by a ``selector`` of fields of its own. What spoils
    predictions isn't looked for again, unless it is told place by place, which predicts nothing.

    A search that was cut short isn't made again; what is computed otherwise counts anew.
    """
    everything, presses = all_fitted(evidence)
    spoilt = findings.diagnosis.spoilt and not any(claim.by_place for claim in findings.diagnosis.claims)
    nothing = spoilt or (presses >= FEW and not selection.after.effects)
    if presses >= MANY or nothing or findings.diagnosis.verdict == "no_mismatch":
        return findings
    report(0.94, "fitting all presses, which are few, for what is handed on")
    field = any(term.modes is not None for term in selection.after.terms)
    anew = not evidence.work.has_ended and (presses < FEW or (field and selector is not select))
    evidence = replace(evidence, work=Work())
    if anew:
        begun = [(term, chosen.rivals) for term, chosen in selection.found if term.modes is None]
        again = partial(_selected, evidence, baseline, family, everything, selector, _silent, begun)
    else:
        again = partial(_fitted_to, everything, evidence, baseline, family, selection)
    handing_on = _with_its_end(_handing_on(findings, again, anew), evidence.work)
    return with_fields_of_all_presses(handing_on, family)


def _fitted_to(
    rows: Indices, evidence: Evidence, baseline: Baseline, family: SkinFamily, selection: Selection
) -> Selection:
    """The selection with its terms fitted to the frames ``rows``.

    How far a field spreads is chosen, not fitted: of too few places it is chosen wrongly.
    """
    linearised, specimen = _building(evidence, baseline, family, rows, _silent), selection.problem.specimen

    def build(solved: Solved | None) -> VoltageProblem:
        return replace(linearised(solved), specimen=specimen)

    if any(term.modes is not None for term in selection.after.terms):
        partitions = _partitions(folds_of(evidence.history.press[rows], FOLDS))
        return selected_again(selection, build, partitions, _silent)
    checked = settled(build, selection.after)
    problem, after = exact(checked.problem, checked.solved)
    return replace(selection, after=after, problem=problem)


def _handing_on(findings: Findings, choose: Callable[[], Selection], anew: bool) -> Findings:
    """The findings, of which effects and calibration of a fit to all presses, as ``choose`` makes it, are handed on;
    where they were chosen ``anew``, whether claimed or not.

    Claims stay those judged by presses held out.
    """
    diagnosis = findings.diagnosis
    try:
        whole = choose()
    except (MeshError, np.linalg.LinAlgError):
        said = "all presses can't be fitted together: what is handed on comes from those not held out"
        return replace(findings, diagnosis=_saying(diagnosis, said))
    limits = _measured_limits(findings)
    # Fitted again are also terms too unsure to be claimed; chosen again, what is there stands by itself.
    claimed = {claim.effect.name for claim in diagnosis.claims}
    effects = (*(effect for effect in whole.after.effects if anew or effect.name in claimed), *limits)
    names = ", ".join(dict.fromkeys(effect.name for effect in effects)) or "no effect"
    said = f"presses are few: handed on is what all of them show together ({names})"
    return replace(findings, whole=whole, diagnosis=replace(_saying(diagnosis, said), of_all_presses=effects))


def _measured_limits(findings: Findings) -> tuple[Effect, ...]:
    """The converter's limit where readings pile up, which no fit holds; one that is fitted is among its terms."""
    if findings.evidence is None or findings.evidence.saturated_v is None:
        return ()
    claims = findings.diagnosis.claims
    return tuple(c.effect for c in claims if c.effect.hypothesis.measured == Measured.READING_LIMIT)


def _saying(diagnosis: Diagnosis, said: str) -> Diagnosis:
    """The diagnosis with one more thing in its reason."""
    return replace(diagnosis, reason=said if diagnosis.reason is None else f"{diagnosis.reason}; {said}")


def _selected(
    evidence: Evidence,
    baseline: Baseline,
    family: SkinFamily,
    fitted: Indices,
    selector: Selector,
    report: Report,
    begun: Shown = (),
) -> Selection:
    """The effects that the frames ``fitted`` show, beginning with those ``begun``, or that other signals have named."""
    build, start = _building(evidence, baseline, family, fitted, report), _start(baseline)
    fixed = [Term(e, e.hypothesis.also_in_readings) for e in baseline.skin.effects]
    partitions = _partitions(folds_of(evidence.history.press[fitted], FOLDS))
    shown = begun or _likeliest(_shown(evidence, baseline), build, fixed, start)
    return selector(build, fixed, shown, start, partitions, report)


def _shown(evidence: Evidence, baseline: Baseline) -> list[Shown]:
    """What the specimen and rest have named, with its rivals there: more than one such set where the specimen can't
    tell which.

    How much the fabric remembers is the skin's own; how it does is taken from the specimen, which tells it better, and
    freed where that predicts better. With all numbers free one that fitted to 1.01 predicted presses held out wildly,
    and so was left out, and specimen and skin seemed to disagree (c306 of `final310`).
    """
    at_rest: list[tuple[Term, tuple[Rival, ...]]] = []
    if baseline.displaced is not None:
        starts = type(baseline.displaced).reading_starts(evidence.sensor, evidence.protocol)
        at_rest = [(Term(baseline.displaced, starts[0].free), ())]
    sets = product(*(_with_size_free(f, evidence.criteria) for f in baseline.specimen_findings))
    apart = (one for one in sets if len({term.name for term, _ in one}) == len(one))
    return [[*one, *at_rest] for one in apart]


def _with_size_free(finding: SpecimenFinding, criteria: Criteria) -> list[tuple[Term, tuple[Rival, ...]]]:
    """What the specimen has shown with only its size free, and what it may be as well."""

    def sized(effect: Effect) -> Term:
        there = (k for k, known in effect.parameters().items() if known.defining and effect.value(k) != known.neutral)
        return Term(effect, tuple(there))

    near = [rival for rival in finding.rivals if rival.short < criteria.significant_gain]
    others = [(sized(rival.effect), (Rival(finding.effect, -rival.short),)) for rival in near]
    return [(sized(finding.effect), finding.rivals), *(one for one in others if one[0].free)]


def _likeliest(shown: list[Shown], build: Problem, fixed: Sequence[Term], start: Calibration) -> Shown:
    """That of several sets which the readings want, its rivals as far behind as they say."""
    if len(shown) == 1:
        return shown[0]
    problem = build(None)
    cost = [problem.solve([*fixed, *(term for term, _ in one)], start).cost for one in shown]
    best = int(np.argmin(cost))
    behind = {other: cost[k] - cost[best] for k, one in enumerate(shown) for term, _ in one for other in [term.effect]}
    return [
        (term, tuple(Rival(r.effect, r.short + behind.get(r.effect, 0.0)) for r in rivals))
        for term, rivals in shown[best]
    ]


def _building(evidence: Evidence, baseline: Baseline, family: SkinFamily, fitted: Indices, report: Report) -> Problem:
    """What linearises the frames ``fitted`` about a fit, or about the start."""
    nominal, start = baseline.skin, _start(baseline)

    def build(solved: Solved | None) -> VoltageProblem:
        calibration, effects = (start, nominal.effects) if solved is None else (solved.calibration, solved.effects)
        skin = family.remeshed(calibration, effects)
        return _problem(evidence, baseline, family, skin, baseline.force_n, fitted, report, solved)

    return build


def _uncorrected(
    evidence: Evidence, baseline: Baseline, family: SkinFamily, fitted: Indices, selection: Selection
) -> Solved:
    """The simulator calibrated without any effect, forces from a linear pad: what the diagnosis is to improve on."""
    alone = [solved for solved in (selection.before, selection.after) if not solved.effects]
    if alone:
        # Where nothing is left of what was tried the calibration may have come further on the way.
        return min(alone, key=rms_of)
    skin = family.remeshed(_start(baseline), ())
    problem = _problem(evidence, baseline, family, skin, baseline.linear_force_n, fitted, _silent)
    if selection.specimen == "disagrees":
        problem = replace(problem, specimen=None)
    return problem.solve((), _start(baseline))


def _counting_the_unknown(
    evidence: Evidence, baseline: Baseline, family: SkinFamily, selection: Selection, found: Predictions
) -> Predictions:
    """The predictions with the misfits held out where what isn't known of fields counts as noise, and where what the
    instrument's form errors are expected to make there is left out."""
    after, fitted = selection.after, selection.problem
    error = form_error(fitted, after, _partitions(fitted.cells), after.effects)
    pressed = any(map(of_presses, after.terms))
    if error.sizes is None and not pressed and all(term.modes is None for term in after.terms):
        return found
    skin = family.remeshed(after.calibration, after.effects)
    problem = _problem(evidence, baseline, family, skin, baseline.force_n, found.held, _silent)
    left = found.after - error.expected(problem, after) * problem.evidence.traces_factor[:, None]
    place_m = pressed_places_m(fitted)
    known = ratio_with_what_is_unknown(problem, after, left, place_m)
    where_pressed = (
        ratio_with_what_is_unknown(problem, after, found.after, place_m, only_presses_show) if pressed else None
    )
    return replace(found, known_ratio=known, where_pressed_ratio=where_pressed)


def _start(baseline: Baseline) -> Calibration:
    skin = baseline.skin
    return Calibration(skin.piezo.zero_ohm_sq, skin.contact_resistance_ohm, START_RATIO, np.zeros(SHAPE))


def _partitions(cells: Indices) -> list[list[int]]:
    """Each of the cells held out in turn."""
    return [[int(k)] for k in np.unique(cells)]


def _problem(
    evidence: Evidence,
    baseline: Baseline,
    family: SkinFamily,
    skin: Skin,
    force_n: Array,
    fitted: Indices,
    report: Report,
    about: Solved | None = None,
) -> VoltageProblem:
    """The joint fit of the frames ``fitted``, under forces (T,C) in newton, linearised about ``skin``, that of the fit
    ``about`` if it is one's."""
    linear = LinearSkin(skin, evidence.history, force_n, fitted, lambda share, text: report(None, text))
    evidence.work.add(linear.derivatives)
    train = evidence.frames(fitted)
    cells = folds_of(evidence.history.press[fitted], FOLDS)
    return VoltageProblem(train, family, linear, baseline.specimen, cells, np.ones(len(fitted)), about=about)


def _with_remainder(findings: Findings, selection: Selection, found: Predictions) -> Findings:
    """The findings with how much of what no name explains a model without a name predicts."""
    problem = selection.problem
    elsewhere = problem.linear.history[found.held]
    nameless = remainder(problem.evidence.history, selection.after.scan_residual, elsewhere)
    return replace(findings, diagnosis=replace(findings.diagnosis, remainder_ratio=ratio(found.after - nameless)))


def _presses_that_differ(selection: Selection, skin: Skin) -> Repeatability | None:
    """How the presses fitted scatter, where that is most of what is left."""
    problem, residual = selection.problem, selection.after.scan_residual
    linear, evidence, history = problem.linear, problem.evidence, problem.evidence.history
    rows = np.flatnonzero(history.touched.any(axis=1) & residual.any(axis=1))

    def scans(other: Skin, force_n: Array) -> Array:
        return evidence.frames(rows).discounted(problem.linear.scans(other, force_n)[rows] / evidence.noise_v)

    place_m, load_n = history.contact_m[rows, 0], np.nansum(linear.force_n[linear.wanted[rows]], axis=1)
    found = repeatability(residual[rows], scans, skin, linear.force_n, history.press[rows], place_m, load_n)
    return found if found.matters(evidence.criteria) else None


def _silent(share: float | None, text: str) -> None:
    """Reports nothing."""
