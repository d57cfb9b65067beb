"""What makes a name less sure than its rivals alone would: misfit that stays, and effects that mend another's form."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from ertskin.diagnosis.contract.claims import SAID, Claim, Reason
from ertskin.diagnosis.criteria import Criteria
from ertskin.physics.effects.effect import Effect, Stage, shown_by
from ertskin.physics.effects.hypothesis import Axis, Measured, Need, Signal

Array = NDArray[np.float64]

MAP_POWER = 5.0
"""To what power a field's confidence is right. Of 32 fields named in four sealed samples (`experiments/concealed`) 2
of 21 below 0.95 had the right map, 9 of 11 above it: the likeliest power is 5.5, 3.5 to 8 within half a nat, and gains
8.5. The 121 other names want 0.8, which gains 0.3: they are left as they are."""

LEFT_POWER = 2.0
"""To what power the part of a misfit that a name explains, no field's, makes it less sure. Of 88 such claims in the
thirteen sealed samples since `twentieth48` and a whole suite (`experiments/concealed/proof/left_power.py`) 31 are
right: 2 is 8.5 nats likelier than 1, half of it by contacts that wander, which are right or wrong together. Before,
when searches missed more of what is beside a right name, 1 was."""

AT_ONCE = "another static law"
"""What a memory's alternative without any lag is called."""

RATHER = 0.5
"""Confidence below which a map is rather wrong than right."""

UNKNOWN_MAPS = "where the fields named are high and low isn't known: press more places, more than once"


def reasoned(before: Sequence[Claim], after: Sequence[Claim], rule: str, why: str) -> list[Claim]:
    """The claims ``after`` a rule, those it made less sure with the reason; both in the same order."""
    found = []
    for old, new in zip(before, after, strict=True):
        reason = Reason(rule, old.confidence, new.confidence, why)
        found.append(new if new.confidence == old.confidence else replace(new, reasons=(*new.reasons, reason)))
    return found


def left_over(
    claims: Sequence[Claim], before: float, left: Callable[[Effect], float], criteria: Criteria
) -> list[Claim]:
    """Claims lose confidence with the part of the misfit (rms, the noise taken off) that they leave, ``left`` being
    what speaks against an effect; all but fields, of which ``of_maps`` takes another power, by ``LEFT_POWER``.

    A name for something else explains in part, and mostly the larger part: a torn patch taken for a field of
    sensitivity left a quarter of the misfit, 7 % of its square. A field whose map is rather wrong than right, but which
    is surer told place by place, answers for the presses fitted alone.
    """

    def share(claim: Claim) -> float:
        if claim.by_force or (claim.effect.stage == Stage.MECHANICS and shown_by(claim.effect, Signal.FORCE)):
            return 1.0
        part = explained(before, left(claim.effect), criteria)
        return part if claim.effect.hypothesis.field else part**LEFT_POWER

    def judged(claim: Claim) -> Claim:
        predicting, by_place = claim.confidence * share(claim), claim.confidence * _explained_by_place(claim, criteria)
        if predicting**MAP_POWER < min(RATHER, by_place):
            return replace(claim, confidence=by_place, by_place=True)
        return replace(claim, confidence=predicting)

    return [judged(claim) for claim in claims]


def _explained_by_place(claim: Claim, criteria: Criteria) -> float:
    """Part of the misfit of the presses fitted that goes where a field is told place by place; nought for any other."""
    return 0.0 if claim.misfits_by_place is None else explained(*claim.misfits_by_place, criteria)


def at_once(claims: Sequence[Claim], by_lag: Sequence[float | None], criteria: Criteria) -> list[Claim]:
    """Memories are as sure as what lags makes them: ``by_lag`` (of the first claims) is the half chi-square that a law
    in their stead which follows presses at once loses. That is no name, but a name must gain what is significant."""
    found = list(claims)
    for k, lost in enumerate(by_lag):
        if lost is None:
            continue
        share = 1 - _unless(lost, criteria)
        static = (1 - share) * claims[k].confidence
        others = ((AT_ONCE, static),) if static > SAID else ()
        alternatives = (*claims[k].alternatives, *others)
        found[k] = replace(claims[k], confidence=share * claims[k].confidence, alternatives=alternatives)
    return found


def misreading(claims: Sequence[Claim], criteria: Criteria) -> list[Claim]:
    """Foam that gives way loses confidence where the sheet feels what the load cell doesn't show: foam passes on all
    of its force, a load cell at a stop shows too little. That is no name, but must gain what is significant."""
    shares = [1.0 if c.misread is None else _unless(c.misread, criteria) for c in claims]
    return [replace(c, confidence=c.confidence * share) for c, share in zip(claims, shares, strict=True)]


def _unless(gain: float, criteria: Criteria) -> float:
    """Share of a confidence that stays beside what has no name and gains so much, in half chi-square, in its stead."""
    return float(expit((criteria.significant_gain - gain) / criteria.evidence_discount))


def left_beyond(claims: Sequence[Claim], before: float, after: float, criteria: Criteria) -> list[Claim]:
    """Names that what no network explains has shown lose confidence with the part of it (rms over noise) they leave."""
    share = explained(before, after, criteria) ** LEFT_POWER
    shown = [shown_by(claim.effect, Signal.NONRECIPROCAL) and not claim.by_force for claim in claims]
    return [replace(c, confidence=c.confidence * share) if seen else c for c, seen in zip(claims, shown, strict=True)]


def of_maps(claims: Sequence[Claim]) -> list[Claim]:
    """A field is right only where its map is: its confidence is that of fields as sure, a power of it.

    What is told place by place predicts nothing, and is right where the places are.
    """
    predicting = [claim.effect.hypothesis.field and not claim.by_place for claim in claims]
    return [
        replace(c, confidence=c.confidence**MAP_POWER, name_confidence=c.confidence) if f else c
        for c, f in zip(claims, predicting, strict=True)
    ]


def noisy(claims: Sequence[Claim], channels: Collection[int], criteria: Criteria) -> list[Claim]:
    """Names of what is wrong with a channel are half as sure where it is one of the noisy ``channels``."""
    doubted = [getattr(claim.effect, "channel", -1) in channels for claim in claims]
    return [
        replace(c, confidence=criteria.doubted_share * c.confidence) if doubt else c
        for c, doubt in zip(claims, doubted, strict=True)
    ]


def none_is_known(claims: Sequence[Claim]) -> bool:
    """Whether all that is named is fields whose maps are rather wrong than right."""
    return bool(claims) and all(claim.right_map is not None and claim.right_map < RATHER for claim in claims)


def left_over_of_force(claims: Sequence[Claim], before: float, after: float, criteria: Criteria) -> list[Claim]:
    """Claims that the load cell made lose confidence with the part of its misfit (rms over its noise) that they leave,
    where that is sure; by the part itself, no power of it."""
    return [replace(c, confidence=c.confidence * explained(before, after, criteria)) for c in claims]


def explained(before: float, after: float, criteria: Criteria) -> float:
    """Part of a misfit (rms over the noise, the noise taken off) that is gone, what is immaterial left out."""
    excess, left = max(before**2 - 1, 0.0), max(after**2 - criteria.mismatch_ratio**2, 0.0)
    return max(0.0, 1 - float(np.sqrt(left / excess))) if excess > 0 else 1.0


def mending(claims: Sequence[Claim], criteria: Criteria) -> list[Claim]:
    """What is small beside one of its kin may only mend that one's form, which becomes its alternative: a field that
    only presses show, contacts that wander.

    Many numbers follow whatever a form leaves; effects of few numbers hold their own. Of nine of these so small in
    eighteen sealed samples seven were right, of four such fields none, such contacts on one recording of five
    (`experiments/concealed`).
    """
    found = []
    for claim in claims:
        strongest = max(_mended_by(claim, claims), key=_excess, default=None)
        share = 1.0 if strongest is None else _excess(claim) / max(criteria.form_share * _excess(strongest), 1e-12)
        if strongest is None or share >= 1:
            found.append(claim)
            continue
        kept = claim.confidence * max(share, criteria.doubted_share)
        alternatives = (*claim.alternatives, (strongest.effect.name, claim.confidence - kept))
        found.append(replace(claim, confidence=kept, alternatives=alternatives))
    return found


def _mended_by(claim: Claim, claims: Sequence[Claim]) -> list[Claim]:
    """The claims whose form this one may mend: its kin, of contacts such as frames at rest show."""
    about = claim.effect.hypothesis
    wanders = about.measured == Measured.CONTACT_PATH
    if not (wanders or (about.field and Need.PRESSES in about.needs)):
        return []
    kin = [c for c in claims if c.effect.name != claim.effect.name and c.effect.hypothesis.kin & about.kin]
    if wanders:
        kin = [c for c in kin if shown_by(c.effect, Signal.REST) or getattr(c.effect, "remembers_air", False)]
    return [c for c in kin if not c.by_force]


def overshadowed(
    claims: Sequence[Claim], shape: tuple[int, ...], ratios: tuple[float, float], left: float, criteria: Criteria
) -> list[Claim]:
    """Names of what a network does lose confidence beside much that no network and no named instrument explains.

    Half a diode, say, also shifts the reciprocal numbers a little, and a little bend of the sheet would explain that.
    ``shape`` is the readings' and the pairs' number, ``ratios`` the misfit of the pairs before and after, ``left`` that
    of the readings beyond what a network explains.
    """
    readings, pairs = shape
    beyond = (readings - pairs) * max(left**2 - criteria.mismatch_ratio**2, 0.0)
    explained = pairs * max(ratios[0] ** 2 - ratios[1] ** 2, 0.0)
    if beyond <= 0:
        return list(claims)
    share = explained / (explained + beyond)

    def unshaken(effect: Effect) -> bool:
        return effect.stage == Stage.MECHANICS or shown_by(effect, Signal.NONRECIPROCAL)

    return [c if unshaken(c.effect) else replace(c, confidence=c.confidence * share) for c in claims]


def static_only(
    claims: Sequence[Claim],
    residuals: tuple[Array, Array],
    rest: NDArray[np.bool_],
    criteria: Criteria,
    shown: Collection[str] = (),
) -> list[Claim]:
    """Names of what carries the current lose confidence where they leave most of what presses change unexplained.

    ``residuals`` (T,P) before and after are in units of the noise, noughts in frames not fitted, ``rest`` (T,) says
    where nothing presses. A field of the sheet can be bent to any systematic error of an electrode; how presses then
    show it can't follow. What is little beside all that they explain at rest says nothing.
    """
    before, after = residuals
    fitted = np.asarray(before.any(axis=1) & after.any(axis=1))
    if not (fitted & rest).any() or not (fitted & ~rest).any():
        return list(claims)
    much, left = (_changing(residual, fitted, rest) for residual in (before, after))
    stood = [float((residual[fitted & rest].mean(axis=0) ** 2).mean()) for residual in (before, after)]
    little = left < criteria.second_share * (stood[0] - stood[1])
    if little or left < criteria.material_ratio**2 - 1 or left < (1 - criteria.most_share) * much:
        return list(claims)

    def doubtful(effect: Effect) -> bool:
        static = effect.stage in (Stage.CONDUCTION, Stage.ELECTRODES) and Axis.TIME not in effect.hypothesis.axes
        return static and effect.name not in shown

    return [replace(c, confidence=criteria.doubted_share * c.confidence) if doubtful(c.effect) else c for c in claims]


def _changing(residual: Array, fitted: NDArray[np.bool_], rest: NDArray[np.bool_]) -> float:
    """Excess mean square of what a misfit of pressed frames has beyond the mean one at rest."""
    change = residual[fitted & ~rest] - residual[fitted & rest].mean(axis=0)
    return float((change**2).mean()) - (1 + 1 / int((fitted & rest).sum()))


def _excess(claim: Claim) -> float:
    return max(claim.ratio_alone**2 - 1, 0.0)
