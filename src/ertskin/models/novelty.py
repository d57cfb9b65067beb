"""How far a frame is from all that a network was trained on, with a stated rate of false alarms.

Three things are asked of a frame, each in units of what a skin as trained shows: what the contacts said leave of it, or
where the network's own answer leaves nothing over, how far it lies within the directions in which trials differ
(Mahalanobis 1936); what it shows outside those directions, where trials show none; and what no resistor network could
give. Limits are quantiles of frames that no fit has seen, their tail a generalised Pareto law (Pickands, Ann. Stat. 3
(1975) 119). A score beyond one is a false alarm as often as ``FALSE_ALARMS`` says, of simulated and recorded frames
alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.calibration.following import FALSE_ALARMS
from ertskin.physics.noise.directions import noise_directions

Array = NDArray[np.float64]

PARTS = 3
TAIL = 0.1
"""Share of the scores from which the tail is taken."""
FEWEST_TAIL = 5
SPIKE = 16.0
"""A reading counts as no more than this in units of the noise's square: spikes are the reader's business."""


@dataclass(frozen=True, eq=False)
class Novelty:
    """Scores of frames by n whitened coordinates of their change.

    ``matrix`` (n,n): from volt to units of the noise, the directions of strongest signal first; ``power`` (k,): mean
    square of trials in those k that stand out of the noise. ``remainder``: rms outside them, as a share of the signal.
    ``noise_v`` of a reading. ``limits`` (3,): of what answers leave or of the distance within, outside, unexplained.
    """

    matrix: Array
    power: Array
    remainder: float
    noise_v: float
    limits: Array

    @classmethod
    def of_trials(cls, trials_v: Array, covariance_v2: Array, recorded_v: Array, noise_v: float) -> Novelty:
        """Directions of clean trials (N,n); ``remainder`` as recorded frames (M,n) show it. Limits are to come."""
        matrix, power = noise_directions(trials_v, covariance_v2)
        kept = max(1, int((power > 1.0).sum()))
        seen = recorded_v @ matrix
        outside = np.maximum((seen[:, kept:] ** 2).sum(axis=1) - (len(power) - kept), 0.0)
        share = outside / np.maximum((seen[:, :kept] ** 2).sum(axis=1), 1.0)
        remainder = float(np.sqrt(np.median(share))) if len(share) else 0.0
        return cls(matrix, power[:kept], remainder, noise_v, np.full(PARTS, np.inf))

    def parts(self, change_v: Array, misfit: Array | None, unexplained: Array | None) -> Array:
        """(N,3) of changes (N,n) in volt: about 1 each for a frame as trained, 0 for what isn't known.

        ``misfit`` (N,): what the network's answer leaves (``Estimate.misfit``). ``unexplained`` (N,): mean square of
        what no resistor network could give, in units of the noise (``unexplained_of``).
        """
        seen = change_v @ self.matrix
        kept, parts = len(self.power), np.zeros((len(change_v), PARTS))
        signal, outside = _squares(seen, kept).T
        parts[:, 0] = (seen[:, :kept] ** 2 / self.power).mean(axis=1) if misfit is None else misfit
        if kept < seen.shape[1]:
            parts[:, 1] = outside / (seen.shape[1] - kept + self.remainder**2 * signal)
        if unexplained is not None:
            parts[:, 2] = unexplained
        return parts

    def score(
        self, change_v: Array, misfit: Array | None, unexplained: Array | None, zero_variance: float | Array = 0.0
    ) -> Array:
        """(N,) largest of the parts over its limit: beyond 1 the frame is unlike those trained on.

        ``zero_variance``: of the zero that changes count from, in units of the noise's.
        """
        share = self.parts(change_v, misfit, unexplained) / self.limits
        share[:, :2] /= 1.0 + np.reshape(zero_variance, (-1, 1))
        return np.asarray(share.max(axis=1))


def unexplained_of(leftover_v: Array, noise_v: float, spare: int, rest_frames: int) -> Array:
    """(N,) mean square of leftovers (N,R) in units of the noise, spikes bent down; ``spare``: readings beyond the
    numbers they tell; ``rest_frames``: whose mean they count from. Nought where nothing is spare."""
    if spare <= 0:
        return np.zeros(len(leftover_v))
    return np.asarray(_bent(leftover_v, noise_v**2 * (1.0 + 1.0 / rest_frames), SPIKE) / spare)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _squares(seen, kept):  # type: ignore[no-untyped-def]
    """(N,2) sums of the squares of (N,n): of the first ``kept`` numbers, and of the others."""
    sums = np.zeros((len(seen), 2))
    for row in range(len(seen)):
        for k in range(kept):
            sums[row, 0] += seen[row, k] ** 2
        for k in range(kept, seen.shape[1]):
            sums[row, 1] += seen[row, k] ** 2
    return sums


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _bent(values, variance, most):  # type: ignore[no-untyped-def]
    """(N,) sums of the squares of (N,R) values over ``variance``, each counted as no more than ``most``."""
    sums = np.zeros(len(values))
    for row in range(len(values)):
        total = 0.0
        for k in range(values.shape[1]):
            total += min(values[row, k] ** 2 / variance, most)
        sums[row] = total
    return sums


def tail_limit(scores: Array, rate: float) -> float:
    """What scores (N,) exceed at that rate: beyond the data by a generalised Pareto tail, never a bounded one."""
    # Live scans don't need it, and it loads for longer than all the rest.
    from scipy.stats import genpareto

    start = float(np.quantile(scores, 1.0 - TAIL))
    beyond = scores[scores > start] - start
    if len(beyond) < FEWEST_TAIL:
        return float("inf")
    shape, _, scale = genpareto.fit(beyond, floc=0.0)
    if shape < 0.0:
        shape, scale = 0.0, float(beyond.mean())
    return start + float(genpareto.isf(rate / TAIL, shape, scale=scale))


def limits_of(*parts: list[Array]) -> Array:
    """(3,) limits, for each part given scores of several kinds of frames: none of them exceeds its limit more often
    than stated, all parts together. Infinite where there are too few scores or they are all nought."""
    limits = []
    for kinds in parts:
        found = [tail_limit(scores, FALSE_ALARMS / PARTS) for scores in kinds if np.any(scores)]
        known = [limit for limit in found if np.isfinite(limit)]
        limits.append(max(known, default=np.inf))
    return np.array(limits)
