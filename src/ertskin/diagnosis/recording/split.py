"""Which frames are fitted, which are kept for the proof: whole presses, so that no fit has seen any of theirs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.recording.evidence import CannotTell, Evidence
from ertskin.physics.history import History

Indices = NDArray[np.intp]

SPLIT = "whole presses, one drawn of any three on end"
SPLIT_SEED = 0
MOST_FRAMES = 900
"""Frames fitted: more make parameters hardly surer, for what a form leaves is the same in neighbouring frames."""

FEW = 12
"""Presses below which what is handed on is chosen from all of them: with six on `rig_a` the four fitted showed neither
the sensitive corner nor the fabric's hysteresis, all six both."""
MANY = 24
"""Presses from which on a third of them is left out of what is handed on: of twelve on `rig_a` the eight fitted named
the right effects, but with a corner half as wide again and a field of 14 % where there is none; forces 0.21 N wrong."""


def fitted_and_held(evidence: Evidence) -> tuple[Indices, Indices]:
    """Frames fitted, at most about ``MOST_FRAMES``, and frames held out: of any three presses on end, one at random.

    Held out are frames with a press in them: those in air all had their part in the calibration at rest.
    Every third press would be whole columns of a grid, and often its edge: places that no fit has seen at all.
    Raises ``CannotTell`` where there are fewer than three presses.
    """
    usable, touching = _usable(evidence)
    history = evidence.history
    if len(touching) < 3:
        raise CannotTell(f"{len(touching)} press{'es' if len(touching) != 1 else ''}: nothing is left to predict")
    draw = np.random.default_rng(SPLIT_SEED).integers(0, 3, size=len(touching) // 3)
    out = np.isin(history.press, touching[3 * np.arange(len(draw)) + draw])
    return thinned(history, np.flatnonzero(usable & ~out), MOST_FRAMES), np.flatnonzero(
        usable & out & history.touched.any(axis=1)
    )


def folds_of(press: NDArray[np.int64], count: int) -> Indices:
    """(n,) which of ``count`` folds, or of as many as there are presses, each frame belongs to, by its press: of any so
    many presses on end one each, drawn.

    In turn they would be whole columns of a grid pressed row by row, and what is predicted places that none of the
    presses fitted is near to.
    """
    numbers, which = np.unique(press, return_inverse=True)
    rng = np.random.default_rng(SPLIT_SEED)
    drawn = np.concatenate([rng.permutation(count) for _ in range(0, len(numbers), count)])
    return np.unique(drawn[which], return_inverse=True)[1].astype(np.intp)


def all_fitted(evidence: Evidence) -> tuple[Indices, int]:
    """Frames of all presses that can be fitted, at most about ``MOST_FRAMES``, and how many presses that are."""
    usable, touching = _usable(evidence)
    return thinned(evidence.history, np.flatnonzero(usable), MOST_FRAMES), len(touching)


def _usable(evidence: Evidence) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """(T,) frames that can be fitted, and the presses that have any in touch."""
    usable = np.isfinite(evidence.scan_v).all(axis=1) & _placed(evidence)
    return usable, np.unique(evidence.history.press[evidence.history.touched.any(axis=1) & usable])


def _placed(evidence: Evidence) -> NDArray[np.bool_]:
    """(T,) frames whose contacts are known, with a force or a depth for each; rest frames among them."""
    history = evidence.history
    known = np.asarray(np.isfinite(history.contact_m).all(axis=-1))
    driven = np.isfinite(history.force_n) | np.isfinite(history.depth_m) | ~history.touched
    return np.asarray((known.any(axis=1) & driven.all(axis=1)) | evidence.rest)


def thinned(history: History, rows: Indices, most: int) -> Indices:
    """At most about ``most`` of the rows, the first and last of every stroke and hold among them."""
    if len(rows) <= most:
        return rows
    phase, press = history.phase[rows], history.press[rows]
    new = np.flatnonzero((np.diff(phase.astype(int)) != 0) | (np.diff(press) != 0))
    kept = np.union1d(np.concatenate([new, new + 1]), np.linspace(0, len(rows) - 1, most).astype(int))
    return rows[kept]
