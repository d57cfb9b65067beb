"""What presses know of a field of sensitivity: ``pressed_places.py RESULTS OUT [CASE ...]``, in this folder.

RESULTS is an opened sample (``results/fifth48``), OUT the folder of its recordings, recorded anew from the secret. One
number for every place pressed is fitted to all presses, nothing else named, and held against the true field: at the
sensing points that something has pressed, and at all of them. It says how much a diagnosis could know.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
import seals  # noqa: E402
from judged import Judged  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from opened_sample import judged, opened  # noqa: E402

from ertskin.diagnosis.fit.terms import Term  # noqa: E402
from ertskin.diagnosis.judge.quantities import NEXT_TO_M  # noqa: E402
from ertskin.diagnosis.recording.evidence import gather  # noqa: E402
from ertskin.diagnosis.recording.split import all_fitted  # noqa: E402
from ertskin.diagnosis.rest.baseline import calibrated  # noqa: E402
from ertskin.diagnosis.search.pressed_places import modes_at, pressed_places_m  # noqa: E402
from ertskin.diagnosis.skin import SkinFamily, _building, _start  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity  # noqa: E402

Array = NDArray[np.float64]

SPREAD = 0.3
"""Standard deviation expected of a place's number: the fit hardly owes anything to it."""


@dataclass(frozen=True)
class Known:
    """Presses and pressed sensing points; mean square misfit over noise without and with the field; correlation with
    the true field at pressed points and at all, and slope at pressed points over the true size."""

    presses: int
    pressed: int
    before: float
    after: float
    at_pressed: float
    everywhere: float
    slope: float


def known(recording: Path, hidden: dict[str, Any], point_m: Array) -> Known:
    """What all presses of a recording know of the field ``hidden``, given at points (N,2)."""
    read = read_recording(recording)
    evidence = gather(read)
    baseline = calibrated(read, evidence)
    noise = baseline.noise
    evidence = replace(evidence, noise_v=noise.rms_v, excess_noise=noise.excess_noise, traces=baseline.traces)
    rows, presses = all_fitted(evidence)
    family = SkinFamily(baseline.skin, "fine")
    problem = _building(evidence, baseline, family, rows, lambda share, text: None)(None)
    fixed = [Term(effect, effect.hypothesis.also_in_readings) for effect in baseline.skin.effects]
    before = problem.solve(fixed, _start(baseline))
    place_m, extent_m = pressed_places_m(problem), evidence.sensor.extent_m
    modes = modes_at(place_m, SPREAD, extent_m)
    even = (0.0,) * len(modes.nodes)
    fields = [Term(start.effect, start.free, modes, even) for start in PiezoInhomogeneity().beginnings(())]
    fits = [problem.solve([*fixed, field.at(field.start)], before.calibration, steps=10) for field in fields]
    after = min(fits, key=lambda fit: fit.cost)
    found = np.asarray(after.effects[-1].map_at(point_m, extent_m))
    true = np.array(hidden["details"]["map"])
    near = np.linalg.norm(point_m[:, None] - place_m, axis=-1).min(axis=1) <= NEXT_TO_M
    numbers = len(rows) * problem.evidence.scan_v.shape[1]
    return Known(
        presses,
        int(near.sum()),
        2 * before.cost / numbers,
        2 * after.cost / numbers,
        float(np.corrcoef(found[near], true[near])[0, 1]),
        float(np.corrcoef(found, true)[0, 1]),
        float(np.polyfit(true[near], found[near], 1)[0]) / hidden["size"],
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("cases", nargs="*", help="these alone")
    given = parser.parse_args()
    try:
        found: list[Judged] = judged(given.results, opened(given.results))["ertskin"]
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    print("| case | form, size | presses | pressed points | misfit² | at pressed points | everywhere | slope |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for case in found:
        hidden = case.truth_of(PiezoInhomogeneity.name)
        recording = given.out / "recordings" / f"{case.name}.h5"
        if hidden is None or (given.cases and case.name not in given.cases) or not recording.exists():
            continue
        one = known(recording, hidden, np.array(case.truth["point_m"]))
        print(
            f"| {case.name} | {hidden['form']} {hidden['size']:.3g} | {one.presses} | {one.pressed} "
            f"| {one.before:.2f} -> {one.after:.2f} | {one.at_pressed:.2f} | {one.everywhere:.2f} | {one.slope:.2f} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
