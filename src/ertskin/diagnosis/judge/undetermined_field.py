"""Fields over the sheet as far as a fit knows them: their map, and presses where they are not known yet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Modes
from ertskin.diagnosis.search.pressed_places import LENGTH, logarithms
from ertskin.diagnosis.search.smooth_fields import covariance_half, node_covariance, node_shape
from ertskin.diagnosis.search.trials import only_presses_show
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.smooth_field import field_design

Array = NDArray[np.float64]

TINY = 1e-12
MOST_LEFT = 0.5
"""Part of the field's standard deviation beforehand that must be left at most where it is known."""


def ratio_with_what_is_unknown(
    problem: VoltageProblem,
    solved: Solved,
    after: Array,
    place_m: Array,
    counting: Callable[[Effect], bool] = lambda effect: True,
) -> float:
    """Misfit over noise of residuals ``after`` (n,P), where what isn't known of the fields ``counting`` is noise.

    ``problem`` is that of the frames held out, linearised about the fit, ``place_m`` (K,2) is where those fitted press.
    What isn't known of a field, of covariance C, is correlated noise J C J' of the frames, with which the quadratic
    form is taken.
    """
    extent_m = problem.evidence.sensor.extent_m
    design = partial(field_design, node_shape(extent_m), extent_m=extent_m)
    skin = problem.family.skin(solved.calibration, solved.effects)
    parts = []
    for number, covariance in _unknown(solved, place_m, extent_m):
        if not counting(solved.effects[number]):
            continue
        size, vector = np.linalg.eigh(covariance)
        root = vector * np.sqrt(np.maximum(size, 0.0))
        found = np.zeros((*problem.evidence.scan_v.shape, root.shape[1]))
        for rows, columns in problem.field_columns(skin, number, design):
            found[rows] = columns @ root
        parts.append(found)
    if not parts:
        return float(np.sqrt((after**2).mean()))
    columns = np.concatenate(parts, axis=-1)
    flat, wrong = columns.reshape(-1, columns.shape[-1]), after.ravel()
    along = flat.T @ wrong
    explained = float(along @ np.linalg.solve(np.eye(len(along)) + flat.T @ flat, along))
    return float(np.sqrt(max(float(wrong @ wrong) - explained, 0.0) / wrong.size))


def _unknown(solved: Solved, place_m: Array, extent_m: Array) -> Iterator[tuple[int, Array]]:
    """Terms with a field of which something isn't known, by their number, and the covariance (M,M) of its nodes."""
    fitted = dict(_covariances(solved))
    for number, effect in enumerate(solved.effects):
        # Of one place, or places all alike, nothing tells by how much others may differ.
        told = only_presses_show(effect) and len(place_m) > 1
        if told and np.ptp(logarithms(effect, place_m, extent_m)) > 0:
            yield number, covariance_elsewhere(effect, place_m, extent_m)
        elif number in fitted:
            yield number, fitted[number]


def covariance_elsewhere(effect: Effect, place_m: Array, extent_m: Array) -> Array:
    """(M,M) covariance of the nodes of a field that only presses show, which is known at the places (K,2) pressed.

    Elsewhere it differs from what is fitted by as much as places differ, one a finger away telling nothing of it: how
    a fit carries it on is a guess, whether by a form of few numbers or by the length that predicted a few presses best.
    """
    half = covariance_half(extent_m, LENGTH)
    seen = field_design(node_shape(extent_m), place_m, extent_m) @ half
    told = seen.T @ np.linalg.pinv(seen @ seen.T, hermitian=True) @ seen
    spread = float(np.std(logarithms(effect, place_m, extent_m)))
    return np.asarray(spread**2 * half @ (np.eye(len(told)) - told) @ half.T)


@dataclass(frozen=True, eq=False)
class Known:
    """What a fit leaves of a smooth field's logarithm at N points: its covariance (N,N), and its standard deviation
    (N,) beforehand."""

    covariance: Array
    spread: Array

    @property
    def error(self) -> Array:
        """(N,) standard errors."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(N,) where the recording has determined it."""
        return np.asarray(self.error < MOST_LEFT * self.spread)


def known_at(solved: Solved, extent_m: Array, point_m: Array) -> dict[str, Known]:
    """By name, what a fit knows of each smooth field at points (N,2)."""
    found = {}
    inflation = max(1.0, float((solved.scan_residual**2).mean()))
    for number, covariance in _covariances(solved, inflation):
        design = field_design(node_shape(extent_m), point_m, extent_m)
        modes = cast(Modes, solved.terms[number].modes)
        beforehand = modes.spread * np.linalg.norm(design @ modes.half, axis=1)
        found[solved.terms[number].name] = Known(design @ covariance @ design.T, beforehand)
    return found


def _covariances(solved: Solved, inflation: float = 1.0) -> Iterator[tuple[int, Array]]:
    """Terms with a smooth field, by their number, and what the fit leaves of the covariance (M,M) of its nodes, where
    the noise has ``inflation`` times its variance."""
    whole = solved.fit.covariance
    for number, term in enumerate(solved.terms):
        if term.modes is not None:
            where = solved.sizes(number)
            yield number, node_covariance(term.modes, _inflated(whole[where, where], inflation))


def _inflated(known: Array, inflation: float) -> Array:
    """The covariance (K,K) of modes, each of unit variance beforehand, where readings tell so many times less."""
    size, vector = np.linalg.eigh(known)
    information = 1 / np.clip(size, TINY, 1.0) - 1
    return np.asarray((vector / (information / inflation + 1)) @ vector.T)
