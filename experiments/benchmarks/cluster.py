"""Synthesis of the paper's trials through ``ertskin.cluster``: one process and two, one Dask worker and two."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
from sheets import SaturatingLaw, padded_sheet
from stopwatch import Stopwatch
from trials import CONTACT_OHM, PROTOCOL

from ertskin.calibration import Calibration
from ertskin.cluster import LocalCluster
from ertskin.cluster.dask import DaskCluster
from ertskin.data.shards import MANIFEST
from ertskin.data.skin_forward import SkinForward
from ertskin.data.synthesis import Plan, synthesize
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.physics.piezo.polynomial import PiezoPolynomial

CLUSTERS = {
    "one process": LocalCluster(1),
    "two processes": LocalCluster(2),
    "Dask, one worker": DaskCluster(workers=1),
    "Dask, two workers": DaskCluster(workers=2),
}


def run(plan: Plan, turns: int) -> dict:
    """Wall seconds of each cluster, its start and the preparation of its workers included, and ratios within a turn.

    Each turn is a program of its own that has loaded what synthesis needs and nothing else: what a program has loaded
    its worker processes load again. Raises ``AssertionError`` unless every shard is the same byte for byte.
    """
    seconds: dict[str, list[float]] = {name: [] for name in CLUSTERS}
    sums = set()
    for _ in range(turns):
        for name in CLUSTERS:
            command = [sys.executable, __file__, name, json.dumps(asdict(plan))]
            measured = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            sums.add(measured["sha256"])
            seconds[name].append(measured["seconds"])
    if len(sums) > 1:
        raise AssertionError("the shards differ between clusters")
    alone = np.array(seconds["one process"])
    return {
        "trials": plan.trials + plan.denoiser_trials + plan.steps * len(nominal_sensor().taxel_m),
        "turns": turns,
        "clusters": {
            name: {"seconds": float(np.median(each)), "times_one_process": float(np.median(alone / np.array(each)))}
            for name, each in seconds.items()
        },
        "load": os.getloadavg()[0],
    }


def turn(name: str, plan: Plan) -> dict:
    """Wall seconds of one synthesis, and the checksums of its shards."""
    with tempfile.TemporaryDirectory() as folder:
        with Stopwatch() as watch:
            synthesize(Path(folder), {}, plan, nominal_sensor().taxel_m, lambda: skin(plan), CLUSTERS[name])
        sums = json.loads((Path(folder) / MANIFEST).read_text())["sha256"]
    return {"seconds": watch.wall_s, "sha256": json.dumps(sums)}


def skin(plan: Plan) -> SkinForward:
    """A calibrated skin like the other sections' sheet, under the paper's pad."""
    pressure_pa = np.linspace(0.0, 6e4, 200)
    law = PiezoPolynomial.fit(pressure_pa, SaturatingLaw().sheet_resistance_ohm_sq(pressure_pa))
    calibration = Calibration("benchmark", nominal_sensor(), law, CONTACT_OHM, indenter_n_per_m=5e4)
    return SkinForward(calibration, PROTOCOL, {}, "fast", padded_sheet().taxel_m, plan.max_force_n)


if __name__ == "__main__":
    print(json.dumps(turn(sys.argv[1], Plan(**json.loads(sys.argv[2])))))
