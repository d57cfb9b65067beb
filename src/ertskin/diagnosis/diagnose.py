"""Where, what, how sure: the whole diagnosis of one recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ertskin.diagnosis.acquisition_signal import acquires
from ertskin.diagnosis.baseline import Baseline, calibrated
from ertskin.diagnosis.claims import (
    MATERIAL_RATIO,
    Claim,
    Diagnosis,
    Estimate,
    HeldOut,
    Rival,
    against,
    estimate,
    verdict_of,
)
from ertskin.diagnosis.confidence import AXES_OF, left_over, left_over_of_force, mending, overshadowed, standing_only
from ertskin.diagnosis.doubt import settling_press
from ertskin.diagnosis.drift_claims import drift_claims
from ertskin.diagnosis.evidence import CannotTell, Evidence, gather
from ertskin.diagnosis.force_fit import STARTS, ForceData, ForceFit, fit_force, free_parameters
from ertskin.diagnosis.linear_skin import LinearSkin
from ertskin.diagnosis.remainder import remainder
from ertskin.diagnosis.repeatability import repeatability
from ertskin.diagnosis.residuals import AxisTest, axis_tests, depends_on
from ertskin.diagnosis.selection import Chosen, Selection, select
from ertskin.diagnosis.skin_family import SHAPE, Calibration, SkinFamily
from ertskin.diagnosis.twins import told_apart
from ertskin.diagnosis.voltage_fit import Solved, Term, VoltageProblem
from hardware.recording import Recording
from physics.conduction.mesh import MeshError
from physics.effects.adc_saturation import AdcSaturation
from physics.effects.contact_drift import ContactDrift
from physics.effects.effect import Effect, Stage
from physics.effects.nonlinear_foam import NonlinearFoam
from physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from physics.history import History
from physics.skin import Skin

Array = NDArray[np.float64]
Report = Callable[[float | None, str], None]
Selector = Callable[..., Selection]
"""With the arguments of ``select``."""

FOLDS = 6
SPLIT_SEED = 0
MOST_FRAMES = 900
"""Frames fitted: more make parameters hardly surer, for what a form leaves is the same in neighbouring frames."""
START_RATIO = 0.0
SATURATED = 0.97
"""Confidence that readings piled up or bent at the top of their range are the converter's doing."""
LONE_PRESS = 2.0
"""Misfit over noise from which a single held-out press is enough to say that something is missing."""
DOUBT = 2.0
"""Standard errors of the noise by which a misfit without a name must be more."""
STANDS_OUT = 3.0
"""Times the median by which a channel's standing error makes it the one that is wrong."""


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything the report draws from: the answer, the evidence and the models before and after.

    Residuals (T,P) of the held-out frames in units of the noise, for the plain simulator and with the terms named.
    """

    diagnosis: Diagnosis
    evidence: Evidence | None = None
    baseline: Baseline | None = None
    selection: Selection | None = None
    held: NDArray[np.intp] | None = None
    residual_before: Array | None = None
    residual_after: Array | None = None
    tests_before: tuple[AxisTest, ...] = ()
    tests_after: tuple[AxisTest, ...] = ()


def diagnose(
    recording: Recording, name: str, report: Report, resolution: str = "fine", selector: Selector = select
) -> Findings:
    """Diagnose a skin's recording; what it can't say ends in a ``cannot_tell`` with the reason.

    ``selector`` chooses the effects.
    """
    try:
        return _diagnose(recording, name, report, resolution, selector)
    except CannotTell as error:
        reason = str(error)
    except np.linalg.LinAlgError:
        reason = "no sheet with contacts gives such readings: check wiring, injected currents and units"
    except MeshError as error:
        reason = f"the sheet can't be meshed: {error}"
    return Findings(Diagnosis(name, "cannot_tell", HeldOut("none", None, None, None, None), reason=reason))


def _diagnose(recording: Recording, name: str, report: Report, resolution: str, selector: Selector) -> Findings:
    report(0.01, "reading the evidence")
    evidence = gather(recording)
    report(0.04, "calibrating at rest, fitting force and depth")
    baseline = calibrated(recording, evidence, resolution)
    noise = baseline.noise
    evidence = replace(evidence, noise_v=noise.rms_v, stray=noise.stray, traces=baseline.traces)
    usable = np.isfinite(evidence.scan_v).all(axis=1) & _placed(evidence)
    fitted, held = _split(evidence, usable)
    fitted = thinned(evidence.history, fitted, MOST_FRAMES)
    train = evidence.frames(fitted)
    number = np.unique(train.history.press, return_inverse=True)[1]
    cells = (number % FOLDS).astype(np.intp)
    family = SkinFamily(baseline.skin, resolution)

    def build(solved: Solved | None) -> VoltageProblem:
        skin = (
            family.remeshed(start, baseline.skin.effects)
            if solved is None
            else family.remeshed(solved.calibration, solved.effects)
        )
        linear = LinearSkin(skin, evidence.history, baseline.force_n, fitted, lambda share, text: report(None, text))
        return VoltageProblem(train, family, linear, baseline.specimen, cells, np.ones(len(train.history)))

    start = Calibration(
        baseline.skin.piezo.zero_ohm_sq, baseline.skin.contact_resistance_ohm, START_RATIO, np.zeros(SHAPE)
    )
    fixed = [Term(e, ("carried",) if isinstance(e, NonlinearFoam) else ()) for e in baseline.skin.effects]
    begun = [(Term(f.effect, f.free), f.rivals) for f in baseline.specimen_findings]
    if baseline.displaced is not None:
        begun.append((Term(baseline.displaced, ("dx_m", "dy_m")), ()))
    partitions = [[int(k)] for k in np.unique(cells)]
    selection = selector(build, fixed, begun, start, partitions, report)
    report(0.85, "predicting presses no fit has seen")
    before, after = _predictions(evidence, baseline, selection, family, held)
    if selection.chosen:
        selection, after = _unspoilt(evidence, baseline, selection, family, held, after)
    findings = _answer(name, evidence, baseline, selection, held, before, after)
    fitted_skin = family.skin(selection.after.calibration, selection.after.effects)
    if (findings.diagnosis.unexplained_ratio or 0.0) > MATERIAL_RATIO:
        report(0.9, "predicting what no name explains")
        nameless = remainder(train.history, selection.after.scan_residual, evidence.history[held])
        ratio = _ratio(after - nameless)
        findings = replace(findings, diagnosis=replace(findings.diagnosis, remainder_ratio=ratio))
        findings = _with_presses_that_differ(findings, selection, fitted_skin)
    report(0.92, "looking for the press that would settle what is in doubt")
    press = settling_press(evidence, fitted_skin, baseline.force_noise.rms_n, findings.diagnosis.claims)
    return replace(findings, diagnosis=replace(findings.diagnosis, next_press=press))


def _with_presses_that_differ(findings: Findings, selection: Selection, skin: Skin) -> Findings:
    """The findings with how the presses fitted scatter, where that is most of what is left."""
    problem, residual = selection.problem, selection.after.scan_residual
    evidence, history = problem.evidence, problem.evidence.history
    rows = np.flatnonzero(history.touched.any(axis=1) & residual.any(axis=1))

    def scans(other: Skin, force_n: Array) -> Array:
        return evidence.frames(rows).discounted(problem.linear.scans(other, force_n)[rows] / evidence.noise_v)

    place_m = history.contact_m[rows, 0]
    found = repeatability(residual[rows], scans, skin, problem.linear.force_n, history.press[rows], place_m)
    if not found.matters:
        return findings
    depends_on = (*findings.diagnosis.unexplained_depends_on, "press")
    diagnosis = replace(findings.diagnosis, presses_differ=found, unexplained_depends_on=depends_on)
    return replace(findings, diagnosis=diagnosis)


def _placed(evidence: Evidence) -> NDArray[np.bool_]:
    """(T,) frames whose contacts are known, rest frames among them."""
    known = np.asarray(np.isfinite(evidence.history.contact_m).all(axis=-1))
    return np.asarray(known.any(axis=1) | evidence.rest)


def _split(evidence: Evidence, usable: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Frames fitted and frames held out: of any three presses on end, one drawn at random.

    Every third press would be whole columns of a grid, and often its edge: places that no fit has seen at all.
    """
    history = evidence.history
    touching = np.unique(history.press[history.touched.any(axis=1) & usable])
    if len(touching) < 3:
        raise CannotTell(f"{len(touching)} press{'es' if len(touching) != 1 else ''}: nothing is left to predict")
    draw = np.random.default_rng(SPLIT_SEED).integers(0, 3, size=len(touching) // 3)
    out = np.isin(history.press, touching[3 * np.arange(len(draw)) + draw])
    return np.flatnonzero(usable & ~out), np.flatnonzero(usable & out)


def thinned(history: History, rows: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """At most about ``most`` of the rows, the first and last of every stroke and hold among them."""
    if len(rows) <= most:
        return rows
    phase, press = history.phase[rows], history.press[rows]
    new = np.flatnonzero((np.diff(phase.astype(int)) != 0) | (np.diff(press) != 0))
    kept = np.union1d(np.concatenate([new, new + 1]), np.linspace(0, len(rows) - 1, most).astype(int))
    return rows[kept]


def _predictions(
    evidence: Evidence,
    baseline: Baseline,
    selection: Selection,
    family: SkinFamily,
    held: NDArray[np.intp],
) -> tuple[Array, Array]:
    """Whitened residuals (n,P) of held-out frames, each solved exactly, without and with what was named."""
    plain_force = baseline.force_n
    if baseline.force_plain is not None and baseline.force_best is not None and baseline.force_best.effects:
        plain_force = np.where(evidence.history.touched, baseline.force_plain.force_n, 0.0)
    before = family.skin(selection.before.calibration, ())
    after = family.remeshed(selection.after.calibration, selection.after.effects)
    return (
        _residual(evidence, before, plain_force, held),
        _residual(evidence, after, baseline.force_n, held),
    )


def _unspoilt(
    evidence: Evidence,
    baseline: Baseline,
    selection: Selection,
    family: SkinFamily,
    held: NDArray[np.intp],
    after: Array,
) -> tuple[Selection, Array]:
    """The selection and its prediction; without its terms where they spoil presses that no fit has seen."""
    plain = family.remeshed(selection.before.calibration, selection.before.effects)
    without = _residual(evidence, plain, baseline.force_n, held)
    if _ratio(after) <= MATERIAL_RATIO * _ratio(without):
        return selection, after
    return replace(selection, after=selection.before, chosen=()), without


def _residual(evidence: Evidence, skin: Skin, force_n: Array, held: NDArray[np.intp]) -> Array:
    readings = skin.readings_v(evidence.history, force_n, held)
    scans = readings.reshape(len(held), -1) @ evidence.protocol.orthonormal
    return evidence.frames(held).discounted((evidence.scan_v[held] - scans) / evidence.noise_v)


def _answer(
    name: str,
    evidence: Evidence,
    baseline: Baseline,
    selection: Selection,
    held: NDArray[np.intp],
    before: Array,
    after: Array,
) -> Findings:
    history = evidence.history[held]
    ratio_before, ratio_after = _ratio(before), _ratio(after)
    claims = [_voltage_claim(selection, chosen, k) for k, chosen in enumerate(selection.chosen)]
    force_claims, force_before, force_after = _force_claims(evidence, baseline, selection)
    force_off = _force_off(evidence, baseline)
    if force_off and force_before is not None and force_after is not None:
        noise_n = baseline.force_noise.rms_n
        force_claims = left_over_of_force(force_claims, force_before / noise_n, force_after / noise_n)
    ratios = ratio_before, ratio_after
    left = _leftover_after(evidence, selection)
    claims = left_over([*claims, *force_claims, *drift_claims(selection)], *ratios)
    shown = {finding.effect.name for finding in baseline.specimen_findings}
    if baseline.displaced is not None:
        shown.add(baseline.displaced.name)
    claims = mending(claims, shown)
    claims = overshadowed(claims, evidence.protocol.orthonormal.shape, ratios, left)
    residuals = (selection.before.scan_residual, selection.after.scan_residual)
    claims = standing_only(claims, *residuals, selection.problem.evidence.rest, shown)
    claims += _instrument_claims(evidence)
    claims.sort(key=lambda c: (c.effect.name == ContactDrift.name, -c.ratio_alone))
    tests_before, tests_after = (
        axis_tests(before, history, evidence.protocol),
        axis_tests(after, history, evidence.protocol),
    )
    instrument = any(c.effect.stage == "acquisition" for c in claims)
    jitters = baseline.noise.jittering >= 0 and not claims
    mismatch = bool(force_claims) or force_off or instrument or left > MATERIAL_RATIO or jitters
    surely = 1 + DOUBT * baseline.noise.error
    broad = ratio_before if claims else _broad_ratio(before, history.press) / surely
    verdict = verdict_of(broad, ratio_after, bool(claims), mismatch)
    if verdict == "explained" and (force_off or left > MATERIAL_RATIO):
        verdict = "partly_explained"
    if verdict in ("unexplained", "no_mismatch"):
        claims = []
    gained = float((before**2).sum() - (after**2).sum())
    freedom = max(1, sum(len(c.parameters) for c in claims))
    p_value = float(chi2.sf(max(gained, 0.0), freedom)) if claims else _misfit_p(before)
    lead = claims[0].effect if claims else None
    stage = None if lead is None else str(lead.stage)
    if verdict == "unexplained" and left > MATERIAL_RATIO:
        stage = str(Stage.ACQUISITION)
    position, radius = _place_of(claims)
    electrodes = tuple(
        int(getattr(c.effect, key))
        for c in claims
        for key in ("electrode", "channel")
        if getattr(c.effect, key, -1) >= 0
    )
    if left > MATERIAL_RATIO:
        electrodes = tuple(dict.fromkeys((*electrodes, *leftover_channels(evidence))))
    if jitters:
        stage, electrodes = str(Stage.ELECTRODES), (baseline.noise.jittering,)
    axes = list(dict.fromkeys(a for c in claims for a in AXES_OF.get(c.effect.name, ())))
    remaining = depends_on(tests_after) if ratio_after > MATERIAL_RATIO else []
    if verdict == "unexplained":
        axes = ["electrode", "time"] if jitters else depends_on(tests_before)
    diagnosis = Diagnosis(
        name,
        verdict,
        HeldOut(
            "whole presses, one drawn of any three on end",
            evidence.noise_v,
            ratio_before,
            ratio_after if claims else ratio_before,
            p_value,
            force_before,
            force_after,
        ),
        stage=stage,
        electrodes=electrodes,
        position_m=position,
        radius_m=radius,
        depends_on=tuple(axes),
        claims=tuple(claims),
        unexplained_ratio=ratio_after if claims else ratio_before,
        unexplained_depends_on=tuple(remaining),
    )
    return Findings(
        diagnosis, evidence, baseline, selection, held, before, after, tuple(tests_before), tuple(tests_after)
    )


def _instrument_claims(evidence: Evidence) -> list[Claim]:
    """A converter at its limit, which the readings themselves show."""
    limit = evidence.saturated_v
    if limit is None:
        return []
    step = 2 * (evidence.protocol.adc_volts_per_count or 1e-4 * abs(limit))
    alone = max(1.0, evidence.leftover_ratio)
    return [
        Claim(AdcSaturation(limit), SATURATED, alone, {"limit_v": Estimate(limit, limit - step, limit + step, "V")})
    ]


def _leftover_after(evidence: Evidence, selection: Selection) -> float:
    """Rms over noise of what no network explains, the instrument's named effects taken off."""
    if evidence.saturated_v is not None:
        return 1.0
    solved, problem = selection.after, selection.problem
    if not acquires(solved.effects):
        return evidence.leftover_ratio
    left = problem.acquisition.residual(problem.family.skin(solved.calibration, solved.effects))
    return float(np.sqrt((left[left != 0] ** 2).mean() / evidence.leftover_share))


def _ratio(residual: Array) -> float:
    return float(np.sqrt((residual**2).mean()))


def _broad_ratio(residual: Array, press: NDArray[np.int64]) -> float:
    """Misfit over noise without the worst press, unless that one is off by more than ``LONE_PRESS``.

    Discretisation and the unlimited pad of the model cost most at the corners, where a single held-out press may lie
    beyond what the others calibrate; a place that is really different is off by far more.
    """
    numbers = np.unique(press)
    ratios = np.array([_ratio(residual[press == number]) for number in numbers])
    if len(numbers) < 3 or ratios.max() > LONE_PRESS:
        return _ratio(residual)
    return _ratio(residual[press != numbers[ratios.argmax()]])


def _misfit_p(residual: Array) -> float:
    """Chance of so large a misfit from white noise alone."""
    return float(chi2.sf(float((residual**2).sum()), residual.size))


def leftover_channels(evidence: Evidence) -> tuple[int, ...]:
    """Channels whose readings are off by what no network explains, frame after frame, far more than the others'."""
    mean = evidence.leftover_v.mean(axis=0)
    size = np.sqrt((mean**2).mean(axis=0))
    return tuple(int(k) for k in np.flatnonzero(size > STANDS_OUT * np.median(size)))


def _voltage_claim(selection: Selection, chosen: Chosen, number: int) -> Claim:
    solved = selection.after
    first = len(solved.terms) - len(selection.chosen)
    term = solved.terms[first + number]
    known = term.effect.parameters()
    estimates = {}
    for key in term.free:
        estimates[key] = estimate(*solved.known(first + number, key), known[key])
    confidence, alternatives = against(chosen.rivals)
    return Claim(term.effect, confidence, chosen.ratio_alone, estimates, alternatives, chosen.rivals)


def _force_claims(
    evidence: Evidence, baseline: Baseline, selection: Selection
) -> tuple[list[Claim], float | None, float | None]:
    plain, best = baseline.force_plain, baseline.force_best
    if plain is None or best is None:
        return [], None, None
    noise = baseline.force_noise.rms_n
    rmse = [float(np.sqrt(np.nanmean(f.residual**2)) * noise) for f in (plain, best)]
    claims = []
    for effect in best.effects:
        claim = _felt(_force_claim(evidence, baseline, best, effect), selection)
        if claim.ratio_alone > 1.03:
            claims.append(claim)
    return claims, rmse[0], rmse[1]


def _force_off(evidence: Evidence, baseline: Baseline) -> bool:
    """Whether force and depth disagree by more than the load cell's noise, effects and all."""
    best, noise = baseline.force_best, baseline.force_noise
    if best is None:
        return False
    known = np.isfinite(best.residual)
    misfit_n = best.residual[known] * noise.rms_n
    phase = np.broadcast_to(evidence.history.phase[:, None], known.shape)[known]
    return noise.exceeded(float(np.sqrt(np.mean(misfit_n**2))), len(misfit_n)) or noise.leans(misfit_n, phase)


def _felt(claim: Claim, selection: Selection) -> Claim:
    """The claim with what the readings add to it: how much of the force the sheet feels."""
    solved = selection.after
    for number, term in enumerate(solved.terms):
        if term.name == claim.effect.name and term.free:
            parameters = dict(claim.parameters)
            for key in term.free:
                parameters[key] = estimate(*solved.known(number, key), term.effect.parameters()[key])
            return replace(claim, effect=term.effect, parameters=parameters)
    return claim


def _force_claim(evidence: Evidence, baseline: Baseline, best: ForceFit, effect: Effect) -> Claim:
    """The fit without this effect, and with each other foam effect in its stead."""
    data = ForceData(
        evidence.history, baseline.force_noise.rms_n, best.support_n_per_m, 1e-3, evidence.sensor.layers[0].thickness_m
    )
    rest = [e for e in best.effects if e.name != effect.name]
    count = int(np.isfinite(best.residual).sum())
    without = fit_force(data, rest, start=best)
    alone = float(np.sqrt(max(1.0, 1 + (without.chi_square - best.chi_square) / count)))
    used = {e.name for e in best.effects}
    rivals = []
    for other, starts in STARTS.items():
        if other not in used:
            replaced = min((fit_force(data, [*rest, s], start=best) for s in starts), key=lambda f: f.chi_square)
            short = 0.5 * (replaced.chi_square - best.chi_square)
            if not told_apart(effect.name, other, evidence.history):
                # A better fit is that of a form, no more.
                short = min(short, 0.0)
            rivals.append(Rival(replaced.effects[-1], short))
    confidence, alternatives = against(tuple(rivals))
    estimates = {}
    known = effect.parameters()
    for key in free_parameters(effect):  # type: ignore[arg-type]
        k = best.names.index(f"{effect.name}.{key}")
        error = float(np.sqrt(max(best.covariance[k, k], 0.0)))
        estimates[key] = estimate(float(getattr(effect, key)), error, known[key])
    return Claim(effect, confidence, alone, estimates, alternatives, tuple(rivals))


def _place_of(claims: list[Claim]) -> tuple[tuple[float, float] | None, float | None]:
    for claim in claims:
        effect = claim.effect
        if isinstance(effect, PiezoInhomogeneity | SheetInhomogeneity) and effect.amplitude != 0:
            return (effect.x_m, effect.y_m), effect.radius_m
    return None, None
