"""Presses that don't repeat: what is left, read as each landing beside its place and pressing harder or softer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import Criteria
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.registry import measured_as
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEP_M, STEP = 1e-4, 0.01
"""Shift and relative change of force at which derivatives are taken."""


@dataclass(frozen=True)
class Repeatability:
    """Scatter of the presses, rms: ``landing_m`` along either axis, ``strength`` relative.

    ``ratio`` is the misfit over noise with each press its own landing and strength, ``without`` the same without;
    ``between_repeats`` the scatter among presses of one place over that among all, as a part of the variance, what goes
    with the load or is the first press's alone taken off; NaN where too few places were pressed twice.
    """

    landing_m: float
    strength: float
    ratio: float
    without: float
    between_repeats: float

    def matters(self, criteria: Criteria) -> bool:
        """Whether presses differ, and not places, by most of what is left: places pressed twice must show it."""
        explained = self.ratio**2 - 1 < (1 - criteria.most_share) * (self.without**2 - 1)
        return self.without > criteria.mismatch_ratio and explained and self.between_repeats > criteria.most_share

    def left_of(self, ratio: float) -> float:
        """What stays of another misfit over noise without what presses that differ make of it."""
        return float(np.sqrt(max(ratio**2 - (self.without**2 - self.ratio**2), 1.0)))

    def as_builtins(self) -> dict[str, float]:
        """For ``diagnosis.json``."""
        return {"landing_rms_m": self.landing_m, "strength_rms": self.strength, "ratio_with_presses_free": self.ratio}


def repeatability(
    residual: Array,
    scans: Callable[[Skin, Array], Array],
    skin: Skin,
    force_n: Array,
    press: Indices,
    place_m: Array,
    load_n: Array,
) -> Repeatability:
    """How presses scatter by the residual (n,P) of pressed frames, to first order.

    ``scans`` (n,P) of a skin under forces (T,C) in newton, both in units of the noise; ``press`` (n,), ``place_m``
    (n,2) and ``load_n`` (n,) say which press a frame belongs to, where that was meant to be and how hard it was.
    """
    columns = _columns(scans, skin, force_n)
    value, variance, place, peak_n, left = [], [], [], [], 0.0
    for number in np.unique(press):
        mine = press == number
        design, wrong = columns[mine].reshape(-1, 3), residual[mine].ravel()
        inverse = np.linalg.pinv(design.T @ design)
        change = inverse @ (design.T @ wrong)
        left += float(((wrong - design @ change) ** 2).sum())
        # A press that missed the skin has no landing.
        if design.any(axis=0).all():
            value.append(change)
            variance.append(np.diag(inverse))
            place.append(place_m[mine][0])
            peak_n.append(load_n[mine].max())
    without = float(np.sqrt((residual**2).mean()))
    if not value:
        return Repeatability(0.0, 0.0, without, without, float("nan"))
    found, error = np.array(value), np.array(variance)
    size = np.sqrt(np.maximum((found**2 - error).mean(axis=0), 0.0))
    return Repeatability(
        landing_m=float(np.sqrt((size[:2] ** 2).mean())),
        strength=float(size[2]),
        ratio=float(np.sqrt(left / residual.size)),
        without=without,
        between_repeats=_between_repeats(found / np.sqrt(error), np.array(place), np.array(peak_n)),
    )


def _columns(scans: Callable[[Skin, Array], Array], skin: Skin, force_n: Array) -> Array:
    """(n,P,3) derivatives of the scans by the landing along x and y, per metre, and by the relative force."""
    unmoved = scans(skin, force_n)
    moved = []
    for key in ("dx_m", "dy_m"):
        other, step_m = _shifted(skin, key)
        moved.append((scans(other, force_n) - unmoved) / step_m)
    harder = (scans(skin, (1 + STEP) * force_n) - unmoved) / STEP
    return np.stack([*moved, harder], axis=-1)


def _shifted(skin: Skin, key: str) -> tuple[Skin, float]:
    """The skin with its indenter elsewhere by a step in metres, away from the bound."""
    landing = measured_as(Measured.LANDING)
    others = [e for e in skin.effects if e.name != landing.name]
    offset = next((e for e in skin.effects if e.name == landing.name), landing())
    offset_m = float(getattr(offset, key))
    step_m = STEP_M if offset_m + STEP_M <= offset.parameters()[key].high else -STEP_M
    return replace(skin, effects=(*others, offset.changed({key: offset_m + step_m}))), step_m


def _between_repeats(value: Array, place_m: Array, peak_n: Array) -> float:
    """Variance of the numbers (n,3), in standard errors, within places over their mean square.

    What presses of one place do alike by how hard they are (n,) or by which came first is no scatter: a wrong law does
    that, and a place that gives way.
    """
    _, first, place = np.unique(np.round(place_m, 4), axis=0, return_index=True, return_inverse=True)
    member = place.ravel()[:, None] == np.arange(len(first))
    alike = np.column_stack([member, peak_n / peak_n.max(), np.isin(np.arange(len(place_m)), first)]).astype(float)
    fitted, _, rank, _ = np.linalg.lstsq(alike, value, rcond=1e-9)
    within = ((value - alike @ fitted) ** 2).sum()
    freedom = value.shape[1] * (len(value) - int(rank))
    return float(within) / freedom / max(float((value**2).mean()), 1e-300) if freedom else float("nan")
