"""How long a live answer takes: from the scan in memory to the contacts, every run counted.

    python live_latency.py MODEL.pt TEST.h5 [REPEATS]

The touched frames of a recording come as live scans, in a session that follows the resting skin; before each the skin
is seen at rest once. One thread; leave a core to it, for what else runs there is counted too.
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


def latencies(session: Session, recording: Recording, repeats: int) -> dict[int, Array]:
    """Seconds of every run, by number of contacts; the first answer of all warms up and is left out."""
    assert recording.frames is not None
    frames = recording.frames
    rest_v = frames.voltage_v[frames.history.phase == Phase.REST]
    contacts = frames.history.touched.sum(axis=1)
    numbers, resting = count(), cycle(rest_v)

    def seen(voltage_v: Array) -> float:
        return session.see(Scan(SCAN_S * next(numbers), np.asarray(voltage_v, dtype=np.float32))).latency_s

    for _ in range(ZERO_SCANS):
        seen(next(resting))
    touched = np.flatnonzero(contacts > 0)
    seen(frames.voltage_v[touched[0]])
    found: dict[int, list[float]] = {}
    for _ in range(repeats):
        for frame in touched:
            seen(next(resting))
            found.setdefault(int(contacts[frame]), []).append(seen(frames.voltage_v[frame]))
    return {number: np.array(runs) for number, runs in sorted(found.items())}


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
        found = latencies(session, test, repeats)
        cold_s = time.perf_counter() - begun - sum(float(runs.sum()) for runs in found.values())
    for number, runs in found.items():
        median, late = 1e3 * np.percentile(runs, [50, 99])
        print(f"{number} contacts: {median:.2f} ms (median), {late:.2f} ms (99 of 100), {len(runs)} runs")
    print(f"loading, zero and first answer: {cold_s:.1f} s")


if __name__ == "__main__":
    main()
