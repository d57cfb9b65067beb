"""The pad's force under a depth-driven stage, the foam's own effects and the yielding support included."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import FoamEffect, Strokes
from ertskin.physics.history import History, Phase

Array = NDArray[np.float64]

_ROUNDS = 60
_CLOSE_N = 1e-6
_SMALL_N = 1e-4
_SLOPES = 0.2, 5.0
"""Range of a secant's slope over the elastic pad's; outside it the elastic one is taken."""
_MENDED = 0.5
"""Part of an error of the other sign above which a step has met a jump."""
_KEPT, _WIDER = 3, 4.0
"""Times that an error keeps its sign until what is in between is made wider, and how much wider."""


def foam_force_n(
    history: History,
    pad_n_per_m: float,
    support_n_per_m: float,
    foam_m: float,
    effects: Sequence[FoamEffect] = (),
    depth_m: Array | None = None,
) -> Array:
    """(T,P) force in newton on every contact from the commanded depth, NaN where there is none, 0 in air.

    Pad and support yield in series (paper eq. 4): the sinking s solves F(s history) = support (depth - s), by secants,
    each frame for itself, over the whole history. ``depth_m`` (T,P) replaces the history's.
    """
    depth = history.depth_m if depth_m is None else depth_m
    place = history.spot
    ordered = sorted(effects, key=lambda e: e.order)
    columns = [
        _column(history, depth[:, p], place[:, p], pad_n_per_m, support_n_per_m, foam_m, ordered)
        for p in range(depth.shape[1])
    ]
    return np.stack(columns, axis=1)


def _column(
    history: History,
    depth: Array,
    place: NDArray[np.intp],
    pad: float,
    support: float,
    foam_m: float,
    effects: Sequence[FoamEffect],
) -> Array:
    pressing = history.touched.any(axis=1) & np.isfinite(depth) & (place >= 0)
    source, real, time_s = lift_offs(history.time_s, pressing)
    touched = pressing[source] & real
    command = np.where(touched, depth[source], 0.0)
    force = command / (1.0 / pad + 1.0 / support)
    if effects:
        most_n = np.multiply(support, command, out=np.zeros(len(command)), where=command > 0)
        secant = _Secant(1.0 / (1.0 + pad / support), most_n)
        for _ in range(_ROUNDS):
            sink = np.where(touched, np.maximum(command - force / support, 0.0), 0.0)
            strokes = Strokes(sink, pad * sink, time_s, touched, place[source], history.press[source], foam_m)
            reaction = pad * sink
            for effect in effects:
                reaction = effect.reaction_n(reaction, strokes)
            force = force + secant.change_n(force, np.where(touched, reaction, 0.0) - force)
            if secant.at_rest:
                break
    return np.where(pressing | (history.phase == Phase.REST), np.maximum(force, 0.0)[real], np.nan)


class _Secant:
    """Steps (N,) towards where an error (N,) in newton is nought, each frame for itself, between nothing and the most
    that the support can bear at its depth (N,).

    A foam may jump from one curve to another at the deepest it has been: what has met an error of either sign stays in
    between, and goes half the way where a secant won't. Frames before move such a jump: where errors keep their sign,
    what is in between is made wider.
    """

    def __init__(self, elastic: float, most_n: Array) -> None:
        self.elastic, self.most_n, count = elastic, most_n, len(most_n)
        self._wrong_n, self._change_n = np.zeros(count), np.zeros(count)
        self._below_n, self._above_n = np.full(count, -np.inf), np.full(count, np.inf)
        self._force_n, self._kept = np.zeros(count), np.zeros(count, dtype=np.intp)

    def change_n(self, force_n: Array, wrong_n: Array) -> Array:
        """(N,) newton, for the error (N,) of the forces (N,) that the last step has led to."""
        self._force_n, kept = force_n, wrong_n * self._wrong_n > 0
        self._kept = np.where(kept, self._kept + 1, 0)
        self._bracket(force_n, wrong_n)
        mended = self._wrong_n - wrong_n
        known = np.abs(mended) > _CLOSE_N
        ratio = np.divide(self._change_n, mended, out=np.full(len(wrong_n), self.elastic), where=known)
        likely = (ratio > _SLOPES[0] * self.elastic) & (ratio < _SLOPES[1] * self.elastic)
        next_n = force_n + np.where(likely, ratio, self.elastic) * wrong_n
        width = self._above_n - self._below_n
        jumped = ~kept & (np.abs(wrong_n) > _MENDED * np.abs(self._wrong_n))
        halved = np.isfinite(width) & (jumped | (next_n <= self._below_n) | (next_n >= self._above_n))
        next_n[halved] = 0.5 * (self._below_n[halved] + self._above_n[halved])
        self._wrong_n, self._change_n = wrong_n, np.clip(next_n, 0.0, self.most_n) - force_n
        return self._change_n

    @property
    def at_rest(self) -> bool:
        """Whether no force moves any more, and every error is small or has changed its sign of late."""
        still = np.abs(self._change_n).max(initial=0.0) < _CLOSE_N
        return bool(still and ((np.abs(self._wrong_n) < _SMALL_N) | (self._kept < _KEPT) | self._held).all())

    @property
    def _held(self) -> NDArray[np.bool_]:
        """(N,) forces at an end of what a stage may press with."""
        force_n = self._force_n + self._change_n
        return ((force_n <= 0.0) & (self._wrong_n <= 0.0)) | ((force_n >= self.most_n) & (self._wrong_n >= 0.0))

    def _bracket(self, force_n: Array, wrong_n: Array) -> None:
        width = np.maximum(self._above_n - self._below_n, _SMALL_N)
        self._below_n = np.where(wrong_n > 0, force_n, self._below_n)
        self._above_n = np.where(wrong_n < 0, force_n, self._above_n)
        moved = (self._kept >= _KEPT) & np.isfinite(width)
        self._above_n = np.where(moved & (wrong_n > 0), force_n + _WIDER * width, self._above_n)
        self._below_n = np.where(moved & (wrong_n < 0), force_n - _WIDER * width, self._below_n)


def lift_offs(time_s: Array, pressing: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.bool_], Array]:
    """Where a press ends, the moment the indenter is in the air again: (N,) source frames, which are real, and times.

    A recording shows the last frame of a press and, perhaps long after, a rest frame; memories must not take the way
    between for a slow retreat. The indenter is taken to leave at the pace of the press's last step.
    """
    leaves = np.flatnonzero(pressing[:-1] & ~pressing[1:])
    step = np.minimum(time_s[leaves] - time_s[np.maximum(leaves - 1, 0)], time_s[leaves + 1] - time_s[leaves])
    source = np.insert(np.arange(len(time_s)), leaves + 1, leaves)
    real = np.insert(np.ones(len(time_s), dtype=bool), leaves + 1, False)
    times = np.insert(time_s, leaves + 1, time_s[leaves] + 0.999 * np.maximum(step, 0.0))
    return source, real, times
