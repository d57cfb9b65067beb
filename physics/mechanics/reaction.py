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

    Pad and support yield in series (paper eq. 4): the sinking s solves F(s history) = support (depth - s), by relaxed
    fixed point over the whole history. ``depth_m`` (T,P) replaces the history's.
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
    pressing = history.touched.any(axis=1) & np.isfinite(depth) & (place >= 0)
    source, real, time_s = lift_offs(history.time_s, pressing)
    touched = pressing[source] & real
    command = np.where(touched, depth[source], 0.0)
    force = command / (1.0 / pad + 1.0 / support)
    if effects:
        relaxation = 1.0 / (1.0 + pad / support)
        for _ in range(_ROUNDS):
            sink = np.where(touched, np.maximum(command - force / support, 0.0), 0.0)
            strokes = Strokes(sink, pad * sink, time_s, touched, place[source], history.press[source], foam_m)
            reaction = pad * sink
            for effect in effects:
                reaction = effect.reaction_n(reaction, strokes)
            change = relaxation * (np.where(touched, reaction, 0.0) - force)
            force = force + change
            if np.abs(change).max(initial=0.0) < _CLOSE_N:
                break
    return np.where(pressing | (history.phase == Phase.REST), np.maximum(force, 0.0)[real], np.nan)


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


def place_numbers(contact_m: Array) -> NDArray[np.intp]:
    """(T,P) number of the spot each contact (T,P,2) presses, -1 where there is none."""
    numbers = np.full(contact_m.shape[:-1], -1, dtype=np.intp)
    touching = np.isfinite(contact_m).all(axis=-1)
    spots = np.round(contact_m[touching] / PLACE_M).astype(np.int64)
    if len(spots):
        numbers[touching] = np.unique(spots, axis=0, return_inverse=True)[1].ravel()
    return numbers
