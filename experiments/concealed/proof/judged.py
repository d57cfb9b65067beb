"""One hidden skin beside what a diagnosis said of it, and whether each claim is right.

A claim is right where the name is hidden and the place is: an electrode or channel must be one of those hidden, and a
field's ``map`` ({"point_m": (n,2), "value": (n,)}) must follow the true one with a correlation of 0.8 at least. A field
without a map is at no place. A map may say at which sensing points it is known; ``where_known`` judges it there alone,
and only if these are enough. Intervals are judged through quantities that mean the same in every form (the loop's
width, the share relaxed in a stated history, ...): a claim states them in ``quantities`` or among its ``parameters``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from threadpoolctl import threadpool_limits

Values = NDArray[np.float64]
Numbers = NDArray[np.intp]

LIKELY, CONFIDENT = 0.5, 0.9
CORRELATION = 0.8
FEWEST_KNOWN = 5
"""Sensing points that a map must know to be judged there alone: of five unrelated values one map in nineteen passes."""
TIE = 0.02
VERDICTS = ("no_mismatch", "explained", "partly_explained", "unexplained", "cannot_tell")
NO_ANSWER: dict[str, Any] = {"verdict": "cannot_tell", "effects": []}


class DiagnosisError(ValueError):
    """A diagnosis that breaks the contract: one line."""


@dataclass(frozen=True)
class Judged:
    """A case opened: its truth as sealed, and the diagnosis as its author wrote it."""

    name: str
    truth: dict[str, Any]
    diagnosis: dict[str, Any]
    where_known: bool = False

    @property
    def kind(self) -> str:
        """Class of the case: one of the nulls, ``single``, ``compound`` or ``family``."""
        return str(self.truth["kind"])

    @property
    def is_null(self) -> bool:
        """Nothing is hidden."""
        return not self.truth["effects"]

    @property
    def hidden(self) -> list[dict[str, Any]]:
        """Hidden effects that have a name."""
        return [one for one in self.truth["effects"] if one["listed"]]

    @property
    def verdict(self) -> str:
        """One of ``VERDICTS``."""
        return str(self.diagnosis["verdict"])

    @property
    def claims(self) -> list[dict[str, Any]]:
        """Effects named, the surest first."""
        said = [{**one, "confidence": self._confidence(one)} for one in self.diagnosis.get("effects") or []]
        return sorted(said, key=lambda one: -float(one["confidence"]))

    def _confidence(self, claim: dict[str, Any]) -> float:
        """That of a map which is right everywhere, or where it is known. Diagnoses that don't state both state that of
        the former, and that of the name."""
        if "confidence_everywhere" in claim:
            return float(claim["confidence" if self.where_known else "confidence_everywhere"])
        return float(claim.get("name_confidence", claim["confidence"]) if self.where_known else claim["confidence"])

    @property
    def likely(self) -> list[dict[str, Any]]:
        """Claims at ``LIKELY`` or more: what counts as said."""
        return [one for one in self.claims if one["confidence"] >= LIKELY]

    def truth_of(self, name: str) -> dict[str, Any] | None:
        """What is hidden under a name."""
        return next((one for one in self.hidden if one["name"] == name), None)

    def is_right(self, claim: dict[str, Any]) -> bool:
        """Right name at the right place."""
        hidden = self.truth_of(claim["name"])
        return hidden is not None and self._right_electrode(claim, hidden) and self._right_map(claim, hidden)

    def _right_electrode(self, claim: dict[str, Any], hidden: dict[str, Any]) -> bool:
        details = hidden["details"]
        true = {v for k in ("electrode", "channel") if (v := details.get(k)) is not None} | set(
            details.get("electrodes", [])
        )
        if not true:
            return True
        stated = claim.get("parameters") or {}
        said = {int(stated[k]["value"]) for k in ("electrode", "channel") if k in stated}
        return bool(said & true) if said else set(claim.get("electrodes") or []) & true != set()

    def _right_map(self, claim: dict[str, Any], hidden: dict[str, Any]) -> bool:
        if "map" not in hidden["details"]:
            return True
        return self.correlation(claim) >= CORRELATION

    def correlation(self, claim: dict[str, Any]) -> float:
        """Of the claimed and the true field at the sheet's sensing points; 0 where no map is given."""
        hidden, said = self.truth_of(claim["name"]), claim.get("map")
        if hidden is None or not said:
            return 0.0
        wanted, true = np.array(self.truth["point_m"]), np.array(hidden["details"]["map"])
        known = self._known_points(said)
        found, true = (_values_at(said, wanted), true) if known is None else (known[1], true[known[0]])
        even = np.ptp(found) == 0.0 or np.ptp(true) == 0.0
        return 0.0 if even else float(np.corrcoef(found, true)[0, 1])

    def _known_points(self, said: dict[str, Any]) -> tuple[Numbers, Values] | None:
        """Sensing points (k,) that a map says it knows, and its values (k,) there; None where it isn't judged so."""
        taxels = said.get("taxels") or {}
        if not self.where_known or "determined" not in taxels:
            return None
        point, known = np.array(self.truth["point_m"]), np.array(taxels["determined"], bool)
        if known.sum() < FEWEST_KNOWN:
            return None
        apart = np.linalg.norm(point[:, None] - np.array(taxels["point_m"], float)[known], axis=-1)
        return apart.argmin(axis=0), np.array(taxels["value"], float)[known]

    @property
    def wrong_confident(self) -> list[str]:
        """Names at ``CONFIDENT`` or more that aren't hidden, or not there."""
        return [one["name"] for one in self.claims if one["confidence"] >= CONFIDENT and not self.is_right(one)]

    @property
    def wrong_likely(self) -> list[str]:
        """The same at ``LIKELY`` or more."""
        return [one["name"] for one in self.likely if not self.is_right(one)]

    @property
    def first_right(self) -> float:
        """1 where the surest name, at ``LIKELY`` or more, is right; a half where a wrong one is as sure."""
        if not self.likely:
            return 0.0
        best = float(self.likely[0]["confidence"])
        rivals = [(float(one["confidence"]), self.is_right(one)) for one in self.claims]
        rivals += [
            (float(o["confidence"]), False)
            for o in self.likely[0].get("alternatives") or []
            if not self.truth_of(o["name"])
        ]
        tied = [right for confidence, right in rivals if confidence >= best - TIE]
        return 1.0 if all(tied) else 0.5 if any(tied) else 0.0

    @property
    def all_found(self) -> bool:
        """Every hidden name is claimed at ``LIKELY`` or more, at its place."""
        right = {one["name"] for one in self.likely if self.is_right(one)}
        return bool(self.hidden) and {one["name"] for one in self.hidden} <= right

    @property
    def own_ratio(self) -> float:
        """The weakest hidden effect's own ratio to the noise; 1 where nothing is hidden."""
        return min((float(one["own"]) for one in self.truth["effects"]), default=1.0)

    def held_out(self, key: str) -> float:
        """A ratio of the held-out part, not-a-number where the diagnosis has none."""
        value = (self.diagnosis.get("held_out") or {}).get(key)
        return float("nan") if value is None else float(value)

    def quantities(self) -> Iterator[tuple[dict[str, Any], str, float, dict[str, Any] | None]]:
        """(hidden, quantity, true, said) for every quantity of every effect rightly named, by the surest claim that
        states it; ``None`` where none does. Several claims of one effect, contacts that drift say, answer for it
        together."""
        for hidden in self.hidden:
            right = [claim for claim in self.likely if claim["name"] == hidden["name"] and self.is_right(claim)]
            stated = [{**(claim.get("parameters") or {}), **(claim.get("quantities") or {})} for claim in right]
            for quantity, true in hidden["meaning"].items() if right else ():
                yield hidden, quantity, true, next((one[quantity] for one in stated if quantity in one), None)

    def intervals(self) -> list[tuple[str, str, bool | None]]:
        """(name, form, holds) for each of the ``quantities``; ``None`` where no claim states it."""
        return [
            (hidden["name"], hidden["form"], None if said is None else said["low"] <= true <= said["high"])
            for hidden, _, true, said in self.quantities()
        ]


def _values_at(said: dict[str, Any], wanted: Values) -> Values:
    """A map's values (n,) at points (n,2)."""
    at, value = np.array(said["point_m"], float), np.array(said["value"], float)
    # Of hundreds of 2 x 2 systems BLAS's threads make 7 s instead of 4 ms where other work takes the cores.
    with threadpool_limits(1, user_api="blas"):
        found = LinearNDInterpolator(at, value)(wanted)
    return np.where(np.isfinite(found), found, NearestNDInterpolator(at, value)(wanted))


def checked(name: str, diagnosis: dict[str, Any] | None) -> dict[str, Any]:
    """The diagnosis; none at all names nothing. Raises ``DiagnosisError`` where it breaks the contract."""
    if diagnosis is None:
        return NO_ANSWER
    for key, expected in (("format", "ertskin-diagnosis"), ("format_version", 1)):
        if diagnosis.get(key) != expected:
            raise DiagnosisError(f"{name}: {key} is {diagnosis.get(key)!r}, expected {expected!r}")
    if diagnosis.get("verdict") not in VERDICTS:
        raise DiagnosisError(f"{name}: verdict is {diagnosis.get('verdict')!r}, expected one of {', '.join(VERDICTS)}")
    return diagnosis
