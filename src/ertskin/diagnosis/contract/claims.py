"""What a diagnosis claims: effects with confidence, parameters with intervals, what else would do; the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration.result import Calibration
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.judge.repeatability import Repeatability
from ertskin.physics.effects.effect import Effect, Parameter, Stage

LEVEL = 0.9
QUANTILE = 1.645
SAID = 0.01
"""Confidence from which an alternative is said."""
FORM = 0.02
"""Part of an effect's size that no interval is narrower than to either side: another form of the same effect moves its
value by so much (a drift that settles by 1 %, a multiplexer that leaks twice by 1 to 3 %)."""


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its interval at ``LEVEL``."""

    value: float
    low: float
    high: float
    unit: str

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it."""
        return {"value": self.value, "low": self.low, "high": self.high, "unit": self.unit, "level": LEVEL}


@dataclass(frozen=True, eq=False)
class FieldMap:
    """The values (n,) of an effect's field at points (n,2) in metre.

    Of its smooth part, where there is one, the standard ``error`` (n,) and where the recording has
    ``determined`` it (n,). ``taxels``: the same at the sensing points, for a map of points between
    them; it is the one that bears ``right``, how likely it follows the true field (correlation of 0.8) over the points
    where it is determined, and ``right_everywhere``, over all of them. Where too few are determined the two are one.
    """

    point_m: NDArray[np.float64]
    value: NDArray[np.float64]
    error: NDArray[np.float64] | None = None
    determined: NDArray[np.bool_] | None = None
    right: float | None = None
    right_everywhere: float | None = None
    taxels: FieldMap | None = None

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it."""
        found: dict[str, Any] = {
            "point_m": np.round(self.point_m, 6).tolist(),
            "value": np.round(self.value, 5).tolist(),
        }
        if self.error is not None:
            found["error"] = np.round(self.error, 5).tolist()
        if self.determined is not None:
            found["determined"] = self.determined.tolist()
        for key, right in (("right", self.right), ("right_everywhere", self.right_everywhere)):
            if right is not None:
                found[key] = round(right, 3)
        return found if self.taxels is None else found | {"taxels": self.taxels.as_builtins()}


@dataclass(frozen=True)
class Rival:
    """Another effect fitted in a claim's stead, and the half chi-square by which it falls short, held out."""

    effect: Effect
    short: float


@dataclass(frozen=True)
class Reason:
    """What a rule did to a claim's confidence, and why."""

    rule: str
    before: float
    after: float
    why: str

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it."""
        return {"rule": self.rule, "before": round(self.before, 3), "after": round(self.after, 3), "why": self.why}


@dataclass(frozen=True)
class Tried:
    """A set of effects that was fitted: its gain over the set before, half chi-square held out, and if it stayed."""

    effects: tuple[str, ...]
    gain: float
    kept: bool

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it."""
        return {"effects": list(self.effects), "gain": round(self.gain, 1), "kept": self.kept}


@dataclass(frozen=True)
class Claim:
    """One named effect. ``ratio_alone``: rms over noise that it by itself would make, held out.

    ``confidence`` is that of its name and, of a field that predicts presses, of a map that does;
    ``name_confidence`` that of the name alone where it is another.
    ``rivals``: what else was fitted in its stead; ``reasons`` for the confidence, in the order in which they count.
    ``of_specimen``: parameters that the readings' fit has taken as the specimen tells them.
    ``quantities`` mean the same in any form of the effect; ``field_map`` is of an effect that has a
    field. ``by_force``: force over depth alone has named it. ``misfits_by_place``: of the presses fitted, over noise,
    without the field that it is and with it told place by place; ``by_place``: that is what makes it sure, and nothing
    is said of places that nothing has pressed. ``misread``: half chi-square that the readings gain where the load cell
    misreads rather than the foam gives way; None of what no load cell does.
    """

    effect: Effect
    confidence: float
    ratio_alone: float
    parameters: dict[str, Estimate]
    alternatives: tuple[tuple[str, float], ...] = ()
    rivals: tuple[Rival, ...] = ()
    reasons: tuple[Reason, ...] = ()
    quantities: dict[str, Estimate] = field(default_factory=dict)
    field_map: FieldMap | None = None
    by_force: bool = False
    misfits_by_place: tuple[float, float] | None = None
    by_place: bool = False
    name_confidence: float | None = None
    of_specimen: dict[str, Estimate] = field(default_factory=dict)
    misread: float | None = None

    @property
    def named(self) -> float:
        """How likely the name is right, wherever the field is high and low."""
        return self.confidence if self.name_confidence is None else self.name_confidence

    @property
    def right_map(self) -> float | None:
        """How likely its map follows the true field over the sensing points where it is determined; None of what has
        none, or of a field of few numbers, whose name stands for its map."""
        return None if self._map_of_taxels is None else self._map_of_taxels.right

    @property
    def right_map_everywhere(self) -> float | None:
        """The same over all sensing points."""
        return None if self._map_of_taxels is None else self._map_of_taxels.right_everywhere

    @property
    def _map_of_taxels(self) -> FieldMap | None:
        return None if self.field_map is None else (self.field_map.taxels or self.field_map)

    @property
    def right(self) -> float:
        """How likely name and place are right: of a field its map as well, where it is determined."""
        return self.confidence if self.right_map is None else self.confidence * self.right_map

    @property
    def right_everywhere(self) -> float:
        """The same of a field whose map is to be right over the whole sheet."""
        everywhere = self.right_map_everywhere
        return self.confidence if everywhere is None else self.confidence * everywhere

    @property
    def in_readings(self) -> bool:
        """Whether readings change with it: what the load cell alone knows of a stage that moves is no more than where
        it is on average."""
        return not (self.by_force and self.effect.stage == Stage.ACQUISITION)

    @property
    def shown(self) -> dict[str, Estimate]:
        """The parameters, of several of a kind their mean and range; of an effect that has none, its quantities."""
        found: dict[str, list[Estimate]] = {}
        for key, one in ((self.parameters | self.of_specimen) or self.quantities).items():
            found.setdefault(key.partition("[")[0], []).append(one)
        return {
            key if len(several) == 1 else f"{key} of {len(several)}": Estimate(
                sum(e.value for e in several) / len(several),
                min(e.low for e in several),
                max(e.high for e in several),
                several[0].unit,
            )
            for key, several in found.items()
        }

    def _reason_of_map(self) -> tuple[Reason, ...]:
        if self.right_map is None or round(self.right, 3) == round(self.confidence, 3):
            return ()
        where = "over the whole sheet" if self.right_map == self.right_map_everywhere else "where it is determined"
        why = f"its map follows the true field {where} with a probability of {self.right_map:.2f}"
        return (Reason("map_known", self.confidence, self.right, why),)

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it: ``confidence`` is ``right``, that of name and place, ``name_confidence``
        that of the name, ``confidence_everywhere`` that of a map which is right over the whole sheet."""
        return {
            "name": self.effect.name,
            "confidence": round(self.right, 3),
            "name_confidence": round(self.named, 3),
            "confidence_everywhere": round(self.right_everywhere, 3),
            "ratio_alone": round(self.ratio_alone, 4),
            "parameters": {key: e.as_builtins() for key, e in self.parameters.items()}
            | {key: {**e.as_builtins(), "source": "specimen"} for key, e in self.of_specimen.items()}
            | {
                key: {"value": value, "low": value, "high": value, "unit": "1", "level": LEVEL}
                for key, value in self.effect.settings().items()
                if key in ("electrode", "channel") and isinstance(value, int) and value >= 0
            },
            "alternatives": [{"name": n, "confidence": round(c, 3)} for n, c in self.alternatives],
            "reasons": [reason.as_builtins() for reason in (*self.reasons, *self._reason_of_map())],
            "quantities": {key: e.as_builtins() for key, e in self.quantities.items()},
            "map": None if self.field_map is None else self.field_map.as_builtins(),
        }


@dataclass(frozen=True)
class HeldOut:
    """Misfit on presses no fit has seen, in units of the noise; forces in newton."""

    split: str
    noise_rms_v: float | None
    ratio_before: float | None
    ratio_after: float | None
    p_value: float | None
    force_before_n: float | None = None
    force_after_n: float | None = None

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` wants it."""
        found = asdict(self)
        force = {"rmse_before_n": found.pop("force_before_n"), "rmse_after_n": found.pop("force_after_n")}
        return found | {"force": None if self.force_before_n is None else force}


@dataclass(frozen=True)
class Diagnosis:
    """The answer, as written to ``diagnosis.json``.

    ``remainder_ratio``: held-out misfit where a model without a name predicts what the names leave; ``presses_differ``
    how presses scatter where that is most of what the names leave; ``specimen`` whether it "agrees" or "disagrees" with
    the skin; ``tried`` the sets of effects fitted to the readings, in order; ``calibration`` what was fitted together
    with the effects, to be simulated with them; ``spoilt``: presses that no fit has seen are predicted worse with the
    effects than without, and none is to be simulated; ``of_all_presses``: where presses are few, the effects fitted to
    all of them, to be simulated instead of those claimed.
    """

    recording: str
    verdict: str
    held_out: HeldOut
    stage: str | None = None
    electrodes: tuple[int, ...] = ()
    position_m: tuple[float, float] | None = None
    radius_m: float | None = None
    depends_on: tuple[str, ...] = ()
    claims: tuple[Claim, ...] = ()
    unexplained_ratio: float | None = None
    unexplained_depends_on: tuple[str, ...] = ()
    remainder_ratio: float | None = None
    presses_differ: Repeatability | None = None
    next_press: dict[str, Any] | None = None
    reason: str | None = None
    specimen: str | None = None
    tried: tuple[Tried, ...] = ()
    calibration: Calibration | None = None
    spoilt: bool = False
    of_all_presses: tuple[Effect, ...] | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects to be simulated: those claimed, with the parameters found, unless they spoil predictions; where
        presses are few, those that all of them show."""
        if self.of_all_presses is not None:
            return self.of_all_presses
        return () if self.spoilt else tuple(claim.effect for claim in self.claims if claim.in_readings)

    def as_builtins(self) -> dict[str, Any]:
        """The contract's dictionary."""
        document = {
            "format": "ertskin-diagnosis",
            "format_version": 1,
            "recording": self.recording,
            "verdict": self.verdict,
            "held_out": self.held_out.as_builtins(),
            "where": {
                "stage": self.stage,
                "electrodes": list(self.electrodes),
                "position_m": None if self.position_m is None else list(self.position_m),
                "radius_m": self.radius_m,
                "depends_on": list(self.depends_on),
            },
            "effects": [claim.as_builtins() for claim in self.claims],
            "handed_on": bool(self.effects),
            "of_all_presses": None if self.of_all_presses is None else [effect.name for effect in self.of_all_presses],
            "unexplained": {
                "ratio": self.unexplained_ratio,
                "depends_on": list(self.unexplained_depends_on),
                "ratio_with_nameless_model": self.remainder_ratio,
                "presses_differ": None if self.presses_differ is None else self.presses_differ.as_builtins(),
            },
            "next_press": self.next_press,
            "specimen": self.specimen,
            "tried": [one.as_builtins() for one in self.tried],
        }
        if self.reason is not None:
            document["reason"] = self.reason
        return {**document, **self.extra}


def estimate(value: float, error: float, known: Parameter) -> Estimate:
    """A value with its interval at ``LEVEL``, given its standard error and what is known of it beforehand."""
    half = QUANTILE * error
    if known.defining:
        half = max(half, FORM * abs(value - known.neutral))
    return Estimate(value, max(value - half, known.low), min(value + half, known.high), known.unit)


def against(rivals: tuple[Rival, ...], criteria: Criteria) -> tuple[float, tuple[tuple[str, float], ...]]:
    """``confidences`` of a term with these rivals."""
    return confidences(tuple((rival.effect.name, rival.short) for rival in rivals), criteria)


def confidences(
    rivals: tuple[tuple[str, float], ...], criteria: Criteria
) -> tuple[float, tuple[tuple[str, float], ...]]:
    """Confidence of a term and of its rivals, from the half chi-square by which they fall short."""
    best: dict[str, float] = {}
    for name, short in rivals:
        best[name] = min(short, best.get(name, np.inf))
    weights = {name: float(np.exp(-max(short, 0.0) / criteria.evidence_discount)) for name, short in best.items()}
    total = 1.0 + sum(weights.values())
    shared = tuple((n, w / total) for n, w in sorted(weights.items(), key=lambda i: -i[1]) if w / total > SAID)
    return min(1.0 / total, criteria.surest_confidence), shared


def verdict_of(
    ratio_before: float, ratio_after: float, named: bool, criteria: Criteria, other_mismatch: bool = False
) -> str:
    """The verdict from held-out ratios; ``other_mismatch``: a material misfit of force or instrument."""
    material = ratio_before > criteria.mismatch_ratio or other_mismatch
    if not named:
        return "unexplained" if material else "no_mismatch"
    return "explained" if ratio_after <= criteria.mismatch_ratio else "partly_explained"


def gathered(claims: tuple[Claim, ...]) -> list[tuple[Claim, str]]:
    """The claims with their names for a reader: those of one name without parameters, at many electrodes, are one."""
    found: dict[str, list[Claim]] = {}
    for number, claim in enumerate(claims):
        found.setdefault(f"{number}" if claim.parameters else claim.effect.name, []).append(claim)
    return [(_together(same), _shown_name(same[0].effect.name, same)) for same in found.values()]


def _together(same: list[Claim]) -> Claim:
    """The first claim of those that are shown as one, with the quantities of them all."""
    return replace(same[0], quantities={key: e for claim in reversed(same) for key, e in claim.quantities.items()})


def _shown_name(name: str, claims: list[Claim]) -> str:
    for key in ("electrode", "channel"):
        where = [number for c in claims if (number := getattr(c.effect, key, -1)) >= 0]
        if where:
            return f"{name} ({key}{'s' * (len(where) > 1)} {', '.join(map(str, where))})"
    return name
