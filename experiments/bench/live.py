"""How long from a scan to its force map: ``python experiments/bench/live.py RECORDING MODEL.pt...``; writes live.md.

Pressed frames of the recording go, one after another, through each model as ``ertskin live`` takes them (ONNX, one
thread), and through its checkpoint with torch. Times are the wall's and, because other programs may share the machine,
the thread's own.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ertskin.hardware.ert_readers.frame import Frame, FrameParser, Type, encode, scan_of, scan_payload
from ertskin.hardware.instrument import Scan
from ertskin.hardware.recording import read_recording
from ertskin.live.export import export_onnx
from ertskin.live.predictor import Predictor
from ertskin.live.session import Session
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.history import Phase

FRAMES, COLD_FRAMES, FIRST = 5000, 1000, 50
PERCENTILES = (50, 99, 99.9)
DIFFERENT = 256
"""Different frames: more than any cache keeps of them."""
ELSEWHERE = np.zeros(1 << 23)
"""64 MB to walk through between two frames: half a second later, other programs have had the caches."""


@dataclass(frozen=True, eq=False)
class Scans:
    """Untouched (n,K,M) and pressed (N,K,M) readings in volt, and the pressed ones as our link sends them."""

    rest_v: np.ndarray
    pressed_v: np.ndarray
    volts_per_count: float

    def frames(self) -> Iterator[bytes]:
        """The bytes of each pressed scan."""
        untouched = np.zeros(self.pressed_v.shape[1:], dtype=bool)
        for number, voltage in enumerate(self.pressed_v):
            count = np.round(voltage / self.volts_per_count).astype(np.int32)
            payload = scan_payload(count, untouched)
            yield encode(Frame(Type.SCAN, 0, number, 0, 400_000, *untouched.shape, payload))


def main(recording: Path, models: list[Path]) -> None:
    """Measure every model, and write the table beside this file."""
    torch.set_num_threads(1)
    scans = scans_of(recording)
    rows = [row for model in models for row in rows_of(model, scans)]
    head = " | ".join(f"{name}, {q:g} %" for name in ("wall (ms)", "processor (ms)") for q in PERCENTILES)
    shape = "x".join(map(str, scans.pressed_v.shape[1:]))
    text = [
        f"{FRAMES} pressed scans of {shape}, one thread. `scan`: readings in memory to force map and contacts;",
        "`bytes`: from the bytes of our link on (checksums, counts, volts). `cold`: 64 MB of other memory written",
        f"between each two of {COLD_FRAMES} frames, as caches are when a scan comes twice a second.",
        "",
        f"| model | from | by | {head} |",
        "| --- | --- | --- |" + " --- |" * 2 * len(PERCENTILES),
        *rows,
        "",
    ]
    Path(__file__).with_name("live.md").write_text("\n".join(text))
    print("\n".join(text))


def scans_of(path: Path) -> Scans:
    """Rest frames and some of the pressed ones of a recording."""
    recording = read_recording(path)
    assert recording.frames is not None
    assert recording.protocol is not None
    voltage, history = recording.frames.voltage_v, recording.frames.history
    pressed = np.flatnonzero((history.phase != Phase.REST) & (history.depth_m[:, 0] > 1e-3))
    chosen = pressed[np.linspace(0, len(pressed) - 1, DIFFERENT).astype(int)]
    return Scans(voltage[history.phase == Phase.REST], voltage[chosen], recording.protocol.adc_volts_per_count or 1e-4)


def rows_of(model: Path, scans: Scans) -> list[str]:
    """The table's rows of one model."""
    reconstruction = Reconstruction.load(model)
    name = str(reconstruction.about.get("model") or type(reconstruction.network).__name__)
    exported = model.with_suffix(".onnx")
    export_onnx(reconstruction, exported)
    session = Session(Predictor(exported))
    for number in range(4):
        session.see(Scan(0.5 * number, scans.rest_v[number]))
    rest = scans.rest_v[:4].mean(axis=0)
    parser = FrameParser()

    def seen(voltage: np.ndarray) -> None:
        assert session.see(Scan(0.0, voltage)).latency_s > 0

    def received(data: bytes) -> None:
        (frame,) = parser.feed(data)
        read = scan_of(frame)
        assert read is not None
        seen((read[0] * scans.volts_per_count).astype(np.float32))

    def by_torch(voltage: np.ndarray) -> None:
        reconstruction.estimate((voltage - rest)[None])

    voltages, messages = list(scans.pressed_v), list(scans.frames())
    ways = {
        "scan | ONNX": timed(seen, voltages),
        "bytes | ONNX": timed(received, messages),
        "bytes, cold | ONNX": timed(received, messages, cold=True),
        "scan | torch": timed(by_torch, voltages),
        "scan, cold | torch": timed(by_torch, voltages, cold=True),
    }
    return [f"| {name} | {way} | {' | '.join(times)} |" for way, times in ways.items()]


def timed(call: Callable[[Any], object], given: list[Any], cold: bool = False) -> list[str]:
    """Percentiles in milliseconds: the wall's, then the thread's own."""
    wall, own = [], []
    for item in islice(cycle(given), FIRST + (COLD_FRAMES if cold else FRAMES)):
        if cold:
            np.add(ELSEWHERE, 1.0, out=ELSEWHERE)
        begin, used = time.perf_counter(), time.thread_time()
        call(item)
        wall.append(1e3 * (time.perf_counter() - begin))
        own.append(1e3 * (time.thread_time() - used))
    return [f"{np.percentile(times[FIRST:], q):.3f}" for times in (wall, own) for q in PERCENTILES]


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(argument) for argument in sys.argv[2:]])
