"""What comes and goes all over the sheet while nothing presses: one number for every place and time, where contacts
would need one each for every frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.linear.sensitivity import Hats, sheet_sensitivity, whitening_of_transfer
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.effect import SheetEffect, Start, shown_by
from ertskin.physics.effects.hypothesis import Axis, Signal
from ertskin.physics.effects.registry import effects_shown_by
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

GRID_M = 4e-3
UNEXPLAINED = 0.2
"""Part of what changes between rest frames, beyond noise, up to which it is taken to be explained."""
SURELY = 3.0
"""Standard deviations of chance above which anything changes."""
DISTINCT = SURELY**2
"""Chi-square of what is uneven, for every number that shapes it, that warmth takes off where it is seen beside a sheet
that changes alike."""


class RestWarmth(NamedTuple):
    """``change_v`` (R,P) the part of the rest frames' changes that warmth explains, or noughts; ``name`` of the effect
    that is clearly seen in them, if one is.

    ``doubt`` chi-square of what is uneven that contacts don't explain: what the error of warmth's form may leave, or
    all that is within chance where warmth is clearly seen. ``uneven`` chi-square that warmth with a name explains of
    what the whole sheet alike doesn't make. ``whole_v`` (R,P) all that it explains, also where the sheet alike makes
    nearly all of it and no part is taken off.
    """

    change_v: Array
    doubt: float
    name: str | None
    uneven: float
    whole_v: Array

    @classmethod
    def none_in(cls, change_v: Array) -> RestWarmth:
        """That nothing warms in changes (R,P)."""
        return cls(np.zeros_like(change_v), 0.0, None, 0.0, np.zeros_like(change_v))


def warmth_at_rest(
    skin: Skin, evidence: Evidence, rows: NDArray[np.bool_], change_v: Array, whole: Array
) -> RestWarmth:
    """What warmth explains of the changes (R,P) of the rest frames ``rows`` (T,), if it explains most of them, those
    too that the ``whole`` sheet (P,) alike doesn't make."""
    level = whole / np.linalg.norm(whole)

    def uneven(part: Array) -> Array:
        """What of a change (R,P) the whole sheet alike doesn't make."""
        return np.asarray(part - np.multiply.outer(part @ level, level))

    def excess(part: Array) -> Array:
        """Of a change (R,P) beyond noise, and of what is uneven of it."""
        count, width = part.shape
        squares = np.array([(part**2).sum(), (uneven(part) ** 2).sum()]) / evidence.noise_v**2
        return np.asarray(squares - count * np.array([width, width - 1]))

    nothing = RestWarmth.none_in(change_v)
    before, chance = excess(change_v), SURELY * np.sqrt(2 * change_v.size)
    if before[0] < chance:
        return nothing
    scans = _heated_scans(skin, evidence, rows)
    explained = [(_fitted(start, scans, change_v, evidence.noise_v), start) for start in _starts(evidence)]
    if not explained:
        return nothing
    best, start = min(explained, key=lambda found: float(excess(change_v - found[0])[0]))
    left, effect = excess(change_v - best), cast(SheetEffect, start.effect)
    if (
        before[1] - left[1] < DISTINCT * max(1, len(set(start.free) - set(start.along)))
        or (left > np.maximum(UNEXPLAINED * before, chance)).any()
    ):
        return nothing
    if before[1] < chance:
        # The sheet alike makes nearly all of it, and a search finds that without the rest frames' help; but what one
        # pattern clearly explains of the little that is left isn't for contacts to share out.
        return RestWarmth(nothing.change_v, chance, effect.name, float(before[1] - left[1]), best)
    doubt = float(((effect.form_error_at_rest * uneven(best)) ** 2).sum()) / evidence.noise_v**2
    return RestWarmth(best, doubt, effect.name, float(before[1] - left[1]), best)


def _starts(evidence: Evidence) -> Iterator[Start]:
    """Every form, those freed once among them, in which a sheet changes unevenly with time and resistor networks show
    it."""
    for kind in effects_shown_by(Signal.REST):
        if not (issubclass(kind, SheetEffect) and Axis.TIME in kind.hypothesis.axes):
            continue
        for start in kind.reading_starts(evidence.sensor, evidence.protocol):
            if start.reciprocal or not shown_by(kind, Signal.NONRECIPROCAL):
                freed = (replace(form, along=start.along) for form in start.effect.freer(start.free))
                yield from (
                    (start,) if _uneven(start, evidence) else (form for form in freed if _uneven(form, evidence))
                )


def _uneven(start: Start, evidence: Evidence) -> bool:
    known = start.effect.parameters()
    typical = {key: known[key].typical for key in start.free if known[key].defining or known[key].neutral == 0.0}
    effect, middle_m = cast(SheetEffect, start.effect.changed(typical)), evidence.sensor.extent_m.mean(axis=0)
    return effect.warmth(middle_m[None], evidence.history.time_s[:1], evidence.sensor, evidence.protocol) is not None


def _heated_scans(skin: Skin, evidence: Evidence, rows: NDArray[np.bool_]) -> Callable[[SheetEffect], Array]:
    """What an effect's warmth does to the rest frames' scans (R,P), to first order, less its mean."""
    points, even = skin.sheet.quadrature_m.reshape(-1, 2), skin.sheet.uniform(skin.piezo.zero_ohm_sq)
    low_m, high_m = skin.sensor.extent_m
    hats, wanted = Hats(low_m, high_m, GRID_M), np.flatnonzero(rows)
    solution = skin.sheet.solve(even, skin.contact_resistance_ohm)
    elements, isotropic = np.arange(len(even)), np.array([[1.0, 0.0, 1.0]])
    whitening, values = whitening_of_transfer(skin.protocol), hats.values(points)
    columns = sheet_sensitivity(solution, elements, values, whitening, isotropic, even.ravel())[0].astype(float)

    level, time_s = columns.sum(axis=1), evidence.history.time_s

    def scans(effect: SheetEffect) -> Array:
        parts = [(level, -np.log(effect.drift(time_s)))]
        warmth = effect.warmth(hats.node_m, time_s, skin.sensor, skin.protocol)
        if warmth is not None:
            parts.append((columns @ warmth[0], warmth[1]))
        change = np.sum([np.multiply.outer(course[wanted], of_pattern) for of_pattern, course in parts], axis=0)
        return np.asarray(change - change.mean(axis=0))

    return scans


def _fitted(start: Start, scans: Callable[[SheetEffect], Array], change_v: Array, noise_v: float) -> Array:
    """(R,P) what the start's kind does to the scans where it fits the changes (R,P) best: in proportion to what it is
    screened along, for all else of it that is free."""
    known = start.effect.parameters()
    others = [key for key in start.free if key not in start.along]
    positive = np.array([known[key].low > 0 for key in others], dtype=bool)

    def scaled(values: Array) -> Array:
        return np.where(positive, np.log(np.where(positive, values, 1.0)), values)

    def at(shape: Array) -> Array:
        values = dict(zip(others, map(float, np.where(positive, np.exp(shape), shape)), strict=True))
        forms = [start.effect.changed({key: known[key].typical, **values}) for key in start.along]
        parts = [scans(cast(SheetEffect, form)).ravel() for form in forms]
        sizes = np.linalg.lstsq(np.transpose(parts), change_v.ravel(), rcond=None)[0]
        return np.asarray((sizes @ np.array(parts)).reshape(change_v.shape))

    low, high = (scaled(np.array([getattr(known[key], end) for key in others])) for end in ("low", "high"))
    begun = scaled(np.array([start.effect.value(key) for key in others]))
    if not others:
        return at(begun)
    fit = least_squares(lambda x: (change_v - at(x)).ravel() / noise_v, begun, bounds=(low, high), diff_step=1e-3)
    return at(fit.x)
