"""Recordings of the bench on disk, each with its truth sealed beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from ertskin.hardware.recording import write_recording
from ertskin.hardware.virtual.bench.bench import Bench
from ertskin.hardware.virtual.bench.nominal import nominal_sensor
from ertskin.hardware.virtual.bench.sealing import seal
from ertskin.hardware.virtual.bench.skin import FINE, Resolution
from ertskin.hardware.virtual.bench.truth import Noise, Truth, draw_truth


def write_bench(
    path: str | Path,
    kind: str = "indentation",
    effects: Mapping[str, float] | None = None,
    seed: int = 0,
    noise: Noise | None = None,
    resolution: Resolution = FINE,
    progress: Callable[[int, int], None] | None = None,
    sealed_in: str | Path | None = None,
) -> Truth:
    """Run plan ``kind`` (``plans.PLANS``) on the skin of a seed and write the recording to ``path``.

    The same seed and effects give the same skin whatever the plan, so training and test recordings belong together.
    With ``sealed_in`` the truth goes into that folder and its commitment beside the recording. Returns the truth.
    """
    truth = draw_truth(nominal_sensor(), seed, dict(effects or {}), noise)
    recording = Bench(truth, resolution=resolution).recording(kind, progress)
    write_recording(path, recording)
    if sealed_in is not None:
        seal(Path(path), truth, Path(sealed_in))
    return truth
