"""A load cell's samples around one frame, and one number out of them."""

from __future__ import annotations

import numpy as np

from ertskin.hardware.instrument import Force

OUTLIER_SIGMAS = 6.0


def mean_force_n(samples: list[Force], begin_s: float, end_s: float, resolution_n: float = 0.01) -> float:
    """Mean of the samples between two times, or the nearest one where there is none; NaN where there are no samples.

    A sample far from the median of at least three is a damaged line that still parsed, and left out.
    """
    if not samples:
        return float("nan")
    inside = [sample.force_n for sample in samples if begin_s <= sample.time_s <= end_s]
    if not inside:
        middle = (begin_s + end_s) / 2
        return min(samples, key=lambda sample: abs(sample.time_s - middle)).force_n
    values = np.array(inside)
    if len(values) < 3:
        return float(values.mean())
    off = np.abs(values - np.median(values))
    scale = 1.4826 * float(np.median(off)) + resolution_n
    return float(values[off <= OUTLIER_SIGMAS * scale].mean())


class Overload:
    """Watches samples for the force limit: two in a row beyond it, so that one damaged line is not an overload."""

    def __init__(self, limit_n: float) -> None:
        self._limit_n = limit_n
        self._beyond = 0

    def seen(self, force_n: float) -> bool:
        """Whether the limit is exceeded by now."""
        self._beyond = self._beyond + 1 if abs(force_n) > self._limit_n else 0
        return self._beyond >= 2
