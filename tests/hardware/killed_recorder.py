"""Records frames as fast as it can, telling each one acknowledged, until it is killed: ``FILE SEED``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import FrameEntry, Recorder, part_of
from ertskin.hardware.recording import Recording
from ertskin.physics.history import Phase

SHAPE = (28, 8)
PLAN = Plan("killed", (Press(((0.0, 0.0),), ramp(1e-3, 1e-4)),) * 1000)
WHOLE = PLAN.presses[0].frames


def voltage(number: int) -> np.ndarray:
    """What frame ``number`` holds."""
    return np.random.default_rng(number).normal(size=SHAPE).astype(np.float32)


def main(path: Path) -> None:
    """Go on with the recording at ``path``, or begin it."""
    if part_of(path).exists():
        recorder, _ = Recorder.resumed(path, PLAN)
    else:
        recorder = Recorder(path, Recording("killed", "", ""), PLAN, SHAPE, counts=False)
    print("ready", recorder.frames, flush=True)
    nothing = np.full(1, np.nan)
    while True:
        number = recorder.frames
        entry = FrameEntry(
            voltage(number), None, 0.5 * number, number // WHOLE, Phase.LOADING, np.full((1, 2), 0.01), nothing, nothing
        )
        recorder.append(entry)
        print(recorder.frames, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
