"""How exact the bench is: the same skins at two resolutions, ``python experiments/concealed/accuracy.py``."""

from __future__ import annotations

import os
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from ertskin.hardware.virtual.bench import FAST, FINE, FINEST, Bench, draw_truth  # noqa: E402
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor  # noqa: E402
from ertskin.hardware.virtual.bench.plans import presses  # noqa: E402

NOISE_V = 2e-3
TAXELS = (0, 8, 14)
DEPTH_M = np.array([1e-3, 2.5e-3, 4e-3])


def main() -> int:
    sensor = nominal_sensor()
    protocol = nominal_protocol(sensor)
    history = presses(sensor.taxel_m[list(TAXELS)], DEPTH_M, holds=0, unloading=False)
    truth = draw_truth(sensor, 1)
    readings, seconds = {}, {}
    for name, resolution in (("finest", FINEST), ("fine", FINE), ("fast", FAST)):
        start = time.process_time()
        readings[name] = Bench(truth, resolution=resolution).frames(history, "accuracy", ideal=True).voltage_v
        seconds[name] = (time.process_time() - start) / len(history)
    print("| resolution | s a frame | rms, µV | of the noise | in the 276 numbers, of the noise | largest, µV |")
    print("| --- | --- | --- | --- | --- | --- |")
    exact = readings["finest"].astype(float)
    for name in ("fine", "fast"):
        error = readings[name] - exact
        network = error.reshape(len(error), -1) @ protocol.orthonormal
        rms, inner = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(network**2))
        print(
            f"| {name} | {seconds[name]:.3f} | {1e6 * rms:.1f} | {rms / NOISE_V:.4f} | {inner / NOISE_V:.3f} "
            f"| {1e6 * np.abs(error).max():.0f} |"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
