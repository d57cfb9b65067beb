"""How the metrics are called and written for people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Metric:
    """A metric's heading, a short one for narrow tables, its unit, and the factor and digits it is shown with."""

    head: str
    short: str
    unit: str
    factor: float = 1.0
    digits: int = 2

    def text(self, value: float) -> str:
        """The number without its unit; a dash where there is none."""
        return f"{self.factor * value:.{self.digits}f}" if np.isfinite(value) else "–"

    def with_unit(self, value: float) -> str:
        """The number with its unit."""
        return f"{self.text(value)} {self.unit}".strip()

    @property
    def label(self) -> str:
        """For an axis: quantity and unit."""
        return f"{self.head} / {self.unit}" if self.unit else self.head


METRICS = {
    "hit_rate_one": Metric("hit rate, one point", "hit 1", "%", 100.0, 1),
    "force_rmse_one_n": Metric("force RMSE, one point", "RMSE 1", "N"),
    "force_correlation_one": Metric("force correlation, one point", "r 1", "", digits=3),
    "exact_rate_two": Metric("exact, two points", "exact 2", "%", 100.0, 1),
    "force_error_two_n": Metric("force error per contact, two points", "error 2", "N"),
    "location_error_mm": Metric("location error", "place", "mm", digits=1),
}
