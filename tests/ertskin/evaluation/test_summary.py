"""The terminal's table."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from ertskin.evaluation.metrics import Score
from ertskin.evaluation.results import ANYWHERE, MethodResult, SeedResult
from ertskin.evaluation.summary import print_table, tables
from ertskin.report.units import METRICS


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


@pytest.mark.parametrize("seeds", [1, 3])
def test_every_number_is_whole_in_eighty_columns_however_long_the_names(seeds: int) -> None:
    long = method("contacts (with sheet_inhomogeneity, piezo_hysteresis)", [0.11 * (k + 1) for k in range(seeds)])
    blank = np.full(4, np.nan)
    anywhere = {name: Score(name, 0.987, blank) for count in (1, 3) for name in (f"{m}_{count}" for m in ANYWHERE)}
    novel = {"novel_rate": Score("novel_rate", 0.123, blank)}
    runs = tuple(SeedResult(run.seed, run.scores | novel | anywhere) for run in long.runs)
    methods = [MethodResult(long.name, "network", runs)]
    stream = io.StringIO()
    print_table(Console(file=stream, width=80), methods)
    words = stream.getvalue().split()
    for names, _ in tables(methods):
        for name in names:
            values = methods[0].values(name)
            assert any(word.startswith(METRICS[name].text(values.mean())) for word in words), name
            assert METRICS[name].short.removesuffix(f" {name[-1]}") in stream.getvalue()
    assert words.count("98.7" if seeds == 1 else "98.7±0.0") == 6
    assert "…" not in stream.getvalue()
    assert "sheet_inhomogeneity," in words
    assert max(map(len, stream.getvalue().splitlines())) <= 80
