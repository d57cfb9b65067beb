"""What a load cell scatters by, and how surely a misfit of force is more than that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.history import History

Array = NDArray[np.float64]

BLOCK_FREEDOM = 19
MOST_OVER_QUIET = 2.5
"""Within presses a cell scatters by this much of what it shows in air at most: a stage that stops a micrometre off adds
to it; more is an effect that changes from frame to frame."""
SHARED = 35 / 18
"""Independent second differences of white noise are so many times fewer than all: neighbours share frames."""


@dataclass(frozen=True)
class ForceNoise:
    """Standard deviation in newton, known from ``freedom`` independent differences."""

    rms_n: float
    freedom: int

    def exceeded(self, rmse_n: float, count: int, criteria: Criteria) -> bool:
        """Whether an rms over ``count`` frames is materially and surely more: a few frames in air tell little."""
        ratio = rmse_n / self.rms_n
        material = ratio > criteria.force_mismatch_ratio
        return material and float(f_distribution.sf(ratio**2, count, self.freedom)) < criteria.force_chance

    def leans(self, misfit_n: Array, phase: NDArray[np.uint8], criteria: Criteria) -> bool:
        """Whether misfits (N,) are materially more than noise and surely of other means going in than coming out.

        A lost motion, say, is no larger than the noise, but of one sign within a stroke.
        """
        strokes = [misfit_n[phase == each] for each in np.unique(phase)]
        between = sum(len(stroke) * (float(stroke.mean()) / self.rms_n) ** 2 for stroke in strokes) / len(strokes)
        material = float(np.sqrt(np.mean(misfit_n**2))) > criteria.force_mismatch_ratio * self.rms_n
        return material and float(f_distribution.sf(between, len(strokes), self.freedom)) < criteria.force_chance


def quiet_noise(evidence: Evidence, scatter_n: float) -> ForceNoise:
    """The load cell's noise in air and, ``scatter_n``, on the rigid block."""
    squares, weights = [], []
    if np.isfinite(evidence.air_n):
        squares.append(evidence.air_n**2)
        weights.append(max(int(evidence.rest.sum()) - 1, 1))
    if np.isfinite(scatter_n) and scatter_n > 0:
        squares.append(scatter_n**2)
        weights.append(BLOCK_FREEDOM)
    if not squares:
        return ForceNoise(0.01, 1)
    return ForceNoise(float(np.sqrt(np.average(squares, weights=weights))), sum(weights))


def pressed_noise(history: History, misfit_n: Array, quiet: ForceNoise) -> ForceNoise:
    """Scatter of a fit's misfits (T,C) from frame to frame of one press: what is smooth over a press is no noise.

    That is the cell's as it is while it measures: a cell that drifts is noisy in air, and presses of foam that ages
    don't repeat. ``quiet`` where a press has too few frames, or where they scatter by far more.
    """
    bends = [
        np.diff(column[(history.press == press) & np.isfinite(column)], n=2)
        for column in np.where(history.touched, misfit_n, np.nan).T
        for press in np.unique(history.press)
    ]
    bend = np.concatenate(bends)
    freedom = int(len(bend) / SHARED)
    rms_n = float(np.sqrt(np.mean(bend**2) / 6)) if len(bend) else np.nan
    if freedom <= quiet.freedom or not 0 < rms_n < MOST_OVER_QUIET * quiet.rms_n:
        return quiet
    return ForceNoise(rms_n, freedom)
