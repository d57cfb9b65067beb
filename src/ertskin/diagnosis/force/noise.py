"""What a load cell scatters by, and how surely a misfit of force is more than that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.recording.evidence import Evidence

Array = NDArray[np.float64]

BLOCK_FREEDOM = 19
REPEATING = 0.7, 2.5
"""Repeated strokes scatter by the noise if by this much of what the cell shows in air: a stage that stops a micrometre
off adds to it, a foam that forgets nothing adds far more."""


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


def force_noise(evidence: Evidence, scatter_n: float) -> ForceNoise:
    """The load cell's noise: in air, on the rigid block, and between presses that repeat the same strokes."""
    history = evidence.history
    squares, weights = [], []
    if np.isfinite(evidence.air_n):
        squares.append(evidence.air_n**2)
        weights.append(max(int(evidence.rest.sum()) - 1, 1))
    if np.isfinite(scatter_n) and scatter_n > 0:
        squares.append(scatter_n**2)
        weights.append(BLOCK_FREEDOM)
    if not squares:
        return ForceNoise(0.01, 1)
    quiet = ForceNoise(float(np.sqrt(np.average(squares, weights=weights))), sum(weights))
    repeats = _pure_error(history.depth_m[:, 0], history.force_n[:, 0], history.press, history.phase)
    if repeats is None or not REPEATING[0] * quiet.rms_n < repeats.rms_n < REPEATING[1] * quiet.rms_n:
        return quiet
    return repeats


def _pure_error(
    depth_m: Array, force_n: Array, press: NDArray[np.int64], phase: NDArray[np.uint8]
) -> ForceNoise | None:
    """Scatter in newton of frames at the same step of presses with the same strokes."""
    groups: dict[tuple[int, int, int], list[float]] = {}
    for number in np.unique(press):
        rows = np.flatnonzero(press == number)
        for step, t in enumerate(rows):
            if np.isfinite(force_n[t]) and np.isfinite(depth_m[t]):
                groups.setdefault((step, int(phase[t]), round(1e6 * float(depth_m[t]))), []).append(float(force_n[t]))
    scattered = [(np.var(v, ddof=1), len(v) - 1) for v in groups.values() if len(v) > 4]
    if not scattered:
        return None
    variance, weight = np.array(scattered).T
    return ForceNoise(float(np.sqrt(np.average(variance, weights=weight))), int(weight.sum()))
