"""The pad's force under a depth-driven stage, the foam's own effects and the yielding support included."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from physics.effects.effect import FoamEffect, Strokes
from physics.history import History

Array = NDArray[np.float64]

_ROUNDS = 60
_CLOSE_N = 1e-7
PLACE_M = 1e-3
"""Contacts closer together than this press the same spot of foam."""


def foam_force_n(
    history: History,
    pad_n_per_m: float,
    support_n_per_m: float,
    foam_m: float,
    effects: Sequence[FoamEffect] = (),
    depth_m: Array | None = None,
) -> Array:
    """(T,P) force in newton on every contact from the commanded depth, NaN where there is none, 0 in air.

    Pad and support yield in series (paper eq. 4): the sinking s solves F(s history) = support (depth - s), by fixed
    point with Aitken's acceleration over the whole history. ``depth_m`` (T,P) replaces the history's.
    """
    depth = history.depth_m if depth_m is None else depth_m
    place = place_numbers(history.contact_m)
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
    touched = history.touched.any(axis=1) & np.isfinite(depth) & (place >= 0)
    command = np.where(touched, depth, 0.0)
    force = pad * support / (pad + support) * command

    def answer(force_n: Array) -> Array:
        sink = np.where(touched, np.maximum(command - force_n / support, 0.0), 0.0)
        strokes = Strokes(sink, pad * sink, history.time_s, touched, place, history.press, foam_m)
        reaction = pad * sink
        for effect in effects:
            reaction = effect.reaction_n(reaction, strokes)
        return np.where(touched, reaction, 0.0)

    for _ in range(_ROUNDS):
        once = answer(force)
        twice = answer(once)
        bend = twice - 2 * once + force
        step = np.where(np.abs(bend) > 1e-12, (once - force) ** 2 / np.where(bend == 0, 1.0, bend), 0.0)
        better = force - step
        close = np.abs(twice - once).max(initial=0.0) < _CLOSE_N
        force = np.where(np.abs(bend) > 1e-12, better, twice)
        if close:
            break
    return np.where(touched | (history.phase == 0), np.maximum(force, 0.0), np.nan)


def place_numbers(contact_m: Array) -> NDArray[np.intp]:
    """(T,P) number of the spot each contact (T,P,2) presses, -1 where there is none."""
    numbers = np.full(contact_m.shape[:-1], -1, dtype=np.intp)
    there = np.isfinite(contact_m).all(axis=-1)
    spots = np.round(contact_m[there] / PLACE_M).astype(np.int64)
    if len(spots):
        numbers[there] = np.unique(spots, axis=0, return_inverse=True)[1].ravel()
    return numbers
