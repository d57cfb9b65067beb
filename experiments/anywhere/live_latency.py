"""How long a live answer takes: from the scan in memory to the contacts, every run counted.

    python live_latency.py MODEL.pt TEST.h5 [REPEATS]

The touched frames of a recording come as live scans, in a session that follows the resting skin: each touch begins from
rest and is held for HELD scans, which differ by MORE_NOISE of the rest frames' reading noise (a recorded frame has its
own, and with as much again it would fit as poorly as if a contact were overlooked). Touches that begin are counted by
themselves too. One thread; leave a core to it, for what else runs there is counted too.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from itertools import count, cycle
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.instrument import Scan
from ertskin.hardware.recording import Recording, read_recording
from ertskin.live.export import export_onnx
from ertskin.live.predictor import Predictor
from ertskin.live.session import Session
from ertskin.live.watch import Watch
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.history import Phase

Array = NDArray[np.float64]
ZERO_SCANS = 4
SCAN_S = 0.1
HELD = 20
"""Scans of a touch: two seconds."""
MORE_NOISE = 0.3


def latencies(session: Session, recording: Recording, repeats: int) -> tuple[float, dict[int, Array]]:
    """When the first answer was there, which warms up and is left out, and (runs, HELD) seconds of every scan by number
    of contacts."""
    assert recording.frames is not None
    frames = recording.frames
    rest_v = frames.voltage_v[frames.history.phase == Phase.REST]
    contacts = frames.history.touched.sum(axis=1)
    numbers, resting = count(), cycle(rest_v)

    def seen(voltage_v: Array) -> float:
        frame = session.see(Scan(SCAN_S * next(numbers), np.asarray(voltage_v, dtype=np.float32)))
        session.rehearse()
        return frame.latency_s

    for _ in range(ZERO_SCANS):
        seen(next(resting))
    touched = np.flatnonzero(contacts > 0)
    seen(frames.voltage_v[touched[0]])
    answered_s = time.perf_counter()
    found: dict[int, list[list[float]]] = {}
    rng, spread_v = np.random.default_rng(0), np.nanstd(rest_v[1:] - rest_v[:-1]) / np.sqrt(2.0)
    for _ in range(repeats):
        for frame in touched:
            seen(next(resting))
            noise_v = MORE_NOISE * spread_v * rng.standard_normal((HELD, *rest_v.shape[1:]))
            noise_v[0] = 0.0
            runs = [seen(frames.voltage_v[frame] + noise) for noise in noise_v]
            found.setdefault(int(contacts[frame]), []).append(runs)
    return answered_s, {number: np.array(runs) for number, runs in sorted(found.items())}


def main() -> None:
    """Median and 99th percentile by number of contacts, and the cold start."""
    model, test = Path(sys.argv[1]), read_recording(sys.argv[2])
    repeats = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    with tempfile.TemporaryDirectory() as folder:
        exported = Path(folder) / "model.onnx"
        export_onnx(Reconstruction.load(model), exported)
        begun = time.perf_counter()
        predictor = Predictor(exported)
        assert predictor.monitor is not None
        assert test.protocol is not None
        session = Session(predictor, ZERO_SCANS, watch=Watch(predictor.monitor, test.protocol))
        answered_s, found = latencies(session, test, repeats)
    for number, runs in found.items():
        for words, some in (("all scans", runs), ("the first of a touch", runs[:, 0])):
            median, late = 1e3 * np.percentile(some, [50, 99])
            print(f"{number} contacts, {words}: {median:.2f} ms (median), {late:.2f} ms (99 of 100), {some.size} scans")
    print(f"loading, zero and first answer: {answered_s - begun:.1f} s")


if __name__ == "__main__":
    main()
