"""What chance alone gains: ``python experiments/concealed/nulls.py RECORDING [--count 40]``.

Nothing is left out of simulated scans: the recording's own calibrated simulator, its frames, white noise of its size.
Each is calibrated anew and every candidate effect screened, as a diagnosis does. The largest gain of each, in half
chi-square held out, is printed beside the gain from which a diagnosis takes an effect.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse  # noqa: E402
import json  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402

from ertskin.diagnosis.any_recording import diagnose_any  # noqa: E402
from ertskin.diagnosis.criteria import DEFAULT  # noqa: E402
from ertskin.diagnosis.fit.terms import Term  # noqa: E402
from ertskin.diagnosis.linear.calibration_vector import Calibration  # noqa: E402
from ertskin.diagnosis.search.candidates import screen  # noqa: E402
from ertskin.diagnosis.search.chosen import Selection  # noqa: E402
from ertskin.diagnosis.search.trials import worth_a_name  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402


class Chance:
    """Stands in for the selection of effects: screens simulated nulls and chooses nothing."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.best: list[tuple[str, float]] = []
        self.least = DEFAULT.significant_gain

    def __call__(
        self,
        build: object,
        fixed: Sequence[Term],
        begun: object,
        start: Calibration,
        partitions: Sequence[Sequence[int]],
        report: object,
    ) -> Selection:
        """The same arguments and result as ``ertskin.diagnosis.search.selection.select``."""
        problem = build(None)  # type: ignore[operator]
        fitted = problem.solve(fixed, start)
        clean = problem.acquisition.scans(problem.family.skin(fitted.calibration, fitted.effects))
        self.least = worth_a_name(problem, fitted)
        real = problem.evidence
        for seed in range(self.count):
            noise = real.noise_v * np.random.default_rng(seed).standard_normal(clean.shape)
            problem.evidence = replace(real, scan_v=clean + noise)
            null = problem.solve(fixed, fitted.calibration, steps=3)
            found = [c for c in screen(problem, null, partitions) if c.term.effect.stage != "acquisition"]
            self.best.append((found[0].name, found[0].gain) if found else ("none", 0.0))
            print(f"null {seed}: {self.best[-1][0]} {self.best[-1][1]:.1f}", flush=True)
        problem.evidence = real
        return Selection(fitted, fitted, (), problem, ())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--count", type=int, default=40)
    options = parser.parse_args()
    chance = Chance(options.count)
    diagnose_any(read_recording(options.recording), options.recording.name, lambda share, text: None, selector=chance)
    gains = np.array([gain for _, gain in chance.best])
    summary = {
        "nulls": len(gains),
        "largest gain": float(gains.max()),
        "95th percentile": float(np.quantile(gains, 0.95)),
        "significant from": DEFAULT.significant_gain,
        "taken from": chance.least,
    }
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
