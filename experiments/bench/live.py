"""How long from a scan to its force map: ``python experiments/bench/live.py MODEL.pt [FRAMES]``; writes live.md.

Times are the wall's and, because other programs may share the machine, the thread's own.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from ertskin.live.export import export_onnx
from ertskin.live.predictor import Predictor
from ertskin.live.session import Session
from ertskin.models.reconstruction import Reconstruction
from hardware.instrument import Scan

PERCENTILES = (50, 99, 99.9)


def main(model: Path, frames: int = 5000) -> None:
    """Scans of the model's protocol, changed by a few noises, one after another, as the live command takes them."""
    exported = model.with_suffix(".onnx")
    reconstruction = Reconstruction.load(model)
    export_onnx(reconstruction, exported)
    session = Session(Predictor(exported))
    rng = np.random.default_rng(0)
    rest = rng.normal(1.5, 0.5, reconstruction.protocol.shape).astype(np.float32)
    noise = rng.normal(0.0, 5e-3, (64, *rest.shape)).astype(np.float32)
    wall, own = [], []
    for number in range(frames):
        scan = Scan(0.5 * number, rest + noise[number % 64])
        begin, used = time.perf_counter(), time.thread_time()
        session.see(scan)
        wall.append(1e3 * (time.perf_counter() - begin))
        own.append(1e3 * (time.thread_time() - used))
    rows = [f"| {q} % | {np.percentile(wall[10:], q):.3f} | {np.percentile(own[10:], q):.3f} |" for q in PERCENTILES]
    shape = "x".join(map(str, reconstruction.protocol.shape))
    text = [
        f"`{type(reconstruction.network).__name__}` on scans of {shape}, {frames} frames, one thread: scan in memory",
        "to force map and contacts.",
        "",
        "| percentile | wall (ms) | processor (ms) |",
        "| --- | --- | --- |",
        *rows,
        "",
    ]
    Path(__file__).with_name("live.md").write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *(int(argument) for argument in sys.argv[2:3]))
