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


CONTACTS = {1: "one contact", 2: "two contacts", 3: "three contacts", 4: "four contacts"}


def _anywhere(count: int, words: str) -> dict[str, Metric]:
    return {
        f"count_rate_{count}": Metric(f"right number, {words}", f"count {count}", "%", 100.0, 1),
        f"location_error_mm_{count}": Metric(f"location error, {words}", f"place {count}", "mm"),
        f"force_error_n_{count}": Metric(f"force error (rms), {words}", f"force {count}", "N"),
        f"missed_{count}": Metric(f"missed a frame, {words}", f"missed {count}", ""),
        f"invented_{count}": Metric(f"invented a frame, {words}", f"invented {count}", ""),
        f"coverage_{count}": Metric(f"90 % regions that hold, {words}", f"in 90% {count}", "%", 100.0, 1),
        f"novel_rate_{count}": Metric(f"frames unlike trained ones, {words}", f"novel {count}", "%", 100.0, 1),
    }


METRICS = {
    "hit_rate_one": Metric("hit rate, one point", "hit 1", "%", 100.0, 1),
    "force_rmse_one_n": Metric("force RMSE, one point", "RMSE 1", "N"),
    "force_correlation_one": Metric("force correlation, one point", "r 1", "", digits=3),
    "exact_rate_two": Metric("exact, two points", "exact 2", "%", 100.0, 1),
    "force_error_two_n": Metric("force error per contact, two points", "error 2", "N"),
    "location_error_mm": Metric("location error", "place", "mm", digits=1),
    "novel_rate": Metric("frames unlike trained ones", "novel", "%", 100.0, 1),
    **{name: metric for count, words in CONTACTS.items() for name, metric in _anywhere(count, words).items()},
}


def in_words(name: str, value: float) -> str:
    """A metric with its heading and unit; of one that isn't shown in tables name and number."""
    metric = METRICS.get(name)
    return f"{name.replace('_', ' ')} {value:.4g}" if metric is None else f"{metric.head} {metric.with_unit(value)}"
