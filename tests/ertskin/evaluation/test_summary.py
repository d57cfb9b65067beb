"""The terminal's table."""

from __future__ import annotations

import io

import numpy as np
from rich.console import Console

from ertskin.evaluation.metrics import Score
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.evaluation.summary import print_table


def method(name: str, rmse_n: list[float], hits: float = 0.99) -> MethodResult:
    def scores(value: float) -> dict[str, Score]:
        blank = np.full(4, np.nan)
        return {
            "hit_rate_one": Score("hit_rate_one", hits, blank),
            "force_rmse_one_n": Score("force_rmse_one_n", value, blank),
            "force_correlation_one": Score("force_correlation_one", 0.99, blank),
            "exact_rate_two": Score("exact_rate_two", hits, blank),
            "force_error_two_n": Score("force_error_two_n", value, blank),
            "location_error_mm": Score("location_error_mm", 3.3, blank),
        }

    return MethodResult(name, "network", tuple(SeedResult(k, scores(v)) for k, v in enumerate(rmse_n)))


def test_the_table_fits_eighty_columns_and_says_mean_and_spread():
    stream = io.StringIO()
    print_table(
        Console(file=stream, width=80), [method("reciprocal", [0.1, 0.2, 0.3]), method("Gauss-Newton imaging", [0.05])]
    )
    lines = stream.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    (ours,) = (line for line in lines if "reciprocal" in line)
    assert "Gauss-Newton imaging" in stream.getvalue()
    assert "…" not in stream.getvalue()
    assert "99.0±0.0" in ours
    assert "0.20±0.10" in ours
    (published,) = (line for line in lines if "as published" in line)
    assert "82.0" in published
    assert "0.51" in published
