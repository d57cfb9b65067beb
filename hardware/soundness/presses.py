"""What the stage and the load cell say: time runs on, depths and forces press."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Recording
from ertskin.hardware.plausibility import Doubt

Array = NDArray[np.float64]


def press_faults(recording: Recording) -> Iterator[Doubt]:
    """What is wrong with the times, depths and forces of the frames."""
    assert recording.frames is not None
    history = recording.frames.history
    yield from backwards("/frames/time_s", history.time_s)
    touched = history.touched
    for name, values in (("depth_m", history.depth_m), ("force_n", history.force_n)):
        if np.isinf(values).any():
            frame = int(np.argwhere(np.isinf(values))[0, 0])
            yield Doubt(f"/frames/{name}", f"an infinite value in frame {frame}", "finite numbers, NaN where unknown")
        else:
            yield from negated(f"/frames/{name}", values[touched], "pressing is positive")
    if touched.sum() > 2:
        if np.ptp(history.time_s) == 0.0:
            yield Doubt("/frames/time_s", "time standing still", "times that rise")
        yield from _dead_load_cell(recording, history.force_n[touched], history.depth_m[touched])


def _dead_load_cell(recording: Recording, force_n: Array, depth_m: Array) -> Iterator[Doubt]:
    """A fault where a load cell that was there says nothing in the frames that press, or the same at any depth.

    Weights placed by hand press with one force, and their depth isn't known.
    """
    known = force_n[np.isfinite(force_n)]
    if recording.rigid_block is not None and not len(known):
        found = "no known force in any press, though the load cell has pressed a rigid block"
        yield Doubt("/frames/force_n", found, "the load cell's force")
    elif len(known) > 2 and np.ptp(known) == 0.0 and np.ptp(np.nan_to_num(depth_m[np.isfinite(force_n)])) > 0.0:
        yield Doubt("/frames/force_n", f"{known[0]:g} N in every press", "the load cell's force")


def negated(field: str, values: Array, rule: str) -> Iterator[Doubt]:
    """A fault where the values, NaN aside, reach further below zero than above.

    One or two may be the noise of a load cell that has hardly touched, as where a press is cut off as it begins.
    """
    known = values[np.isfinite(values)]
    if known.size > 2 and -known.min() > known.max():
        yield Doubt(field, f"values from {known.min():.3g} to {known.max():.3g}, as if negated", rule)


def backwards(field: str, time_s: Array) -> Iterator[Doubt]:
    """A fault where time runs backwards."""
    back = np.flatnonzero(np.diff(time_s) < 0)
    if len(back):
        step = time_s[back[0] + 1] - time_s[back[0]]
        yield Doubt(field, f"time running backwards by {-step:.3g} s after entry {back[0]}", "times that rise")
