"""What every method scored, over its seeds, and the files that keep it."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.outcome import Array, Outcome
from ertskin.evaluation.predictions import as_builtins
from ertskin.files import write_whole

Kind = Literal["network", "yardstick", "bound"]
FORMAT, FORMAT_VERSION = "ertskin-evaluation", 1
ANYWHERE = ("count_rate", "location_error_mm", "force_error_n", "missed", "invented", "coverage", "novel_rate")
"""Metrics of touches anywhere, each by the number of contacts: ``count_rate_1``."""
PAPER = {
    "hit_rate_one": (0.82, 0.12),
    "force_rmse_one_n": (0.51, 0.72),
    "force_correlation_one": (0.95, None),
    "exact_rate_two": (0.785, None),
    "force_error_two_n": (5.0, 2.2),
}
"""The paper's numbers (IV-D) as value and what follows its ±; None where it gives none."""


@dataclass(frozen=True, eq=False)
class SeedResult:
    """One training of a method: its scores by metric name, what it said of the test frames, its MLflow run, and what it
    said of touches anywhere."""

    seed: int
    scores: dict[str, Score]
    outcome: Outcome | None = None
    run_id: str | None = None
    contacts: ContactOutcome | None = None


@dataclass(frozen=True, eq=False)
class MethodResult:
    """A method and its trainings; ``note`` says in a few words what it is. ``grid``: the one it answers on, which ends
    its name, where several are compared."""

    name: str
    kind: Kind
    runs: tuple[SeedResult, ...]
    note: str = ""
    grid: str = ""

    @property
    def family(self) -> str:
        """The name without the grid."""
        return self.name.removesuffix(f" {self.grid}")

    def values(self, metric: str) -> Array:
        """(S,) the metric of each seed that has it."""
        return np.array([run.scores[metric].value for run in self.runs if metric in run.scores])

    def per_taxel(self, metric: str) -> Array:
        """(n,) mean over the seeds; NaN where no frame touched the taxel."""
        return np.mean([run.scores[metric].per_taxel for run in self.runs if metric in run.scores], axis=0)

    def as_builtins(self) -> dict[str, Any]:
        """As values JSON can hold."""
        seeds = [{"seed": run.seed, "metrics": as_builtins(run.scores)} for run in self.runs]
        grid = {"grid": self.grid} if self.grid else {}
        return {"name": self.name, "kind": self.kind, "note": self.note, **grid, "seeds": seeds}


def metric_names(methods: Sequence[MethodResult]) -> list[str]:
    """Every metric some method has, the paper's first, those of touches anywhere by the number of contacts."""
    known = {name for method in methods for run in method.runs for name in run.scores}
    first = [name for name in (*PAPER, "location_error_mm", "novel_rate") if name in known]
    return first + sorted(known - set(first), key=lambda name: (name[-1], ANYWHERE.index(name[:-2])))


def write_results(folder: Path, methods: Sequence[MethodResult], about: dict[str, Any]) -> tuple[Path, Path]:
    """``evaluation.json`` with everything and ``evaluation.csv`` with a line per method and metric, into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "about": about,
        "paper": {name: {"value": value, "spread": spread} for name, (value, spread) in PAPER.items()},
        "methods": [method.as_builtins() for method in methods],
    }
    as_json, as_csv = folder / "evaluation.json", folder / "evaluation.csv"
    write_whole(as_json, json.dumps(content, indent=1))
    write_whole(as_csv, _table(methods))
    return as_json, as_csv


def _table(methods: Sequence[MethodResult]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["method", "kind", "metric", "seeds", "mean", "spread_over_seeds", "taxel_mean", "taxel_spread"])
    for method in methods:
        for metric in metric_names([method]):
            values = method.values(metric)
            scores = [run.scores[metric] for run in method.runs if metric in run.scores]
            numbers = [values.mean(), values.std(), *np.mean([[s.taxel_mean, s.taxel_spread] for s in scores], axis=0)]
            written = [f"{number:.6g}" if np.isfinite(number) else "" for number in numbers]
            writer.writerow([method.name, method.kind, metric, len(values), *written])
    return stream.getvalue()
