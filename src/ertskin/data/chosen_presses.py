"""A recording thinned to some of its presses, as if no others had been made."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.history import Phase


def presses_of(recording: Recording, which: Iterable[int]) -> Recording:
    """The recording with the presses numbered ``which`` alone, in the order they were made.

    Kept are each press's frames, those at rest before it among them, and the rest after the last one. Times and numbers
    stay. What was measured beside the presses (specimen, rigid block) stays too: it takes no press. Raises
    ``UserError`` for no press, or one that the recording doesn't have.
    """
    wanted = sorted({int(number) for number in which})
    if recording.frames is None:
        raise UserError("the recording has no frames to choose presses from")
    known = made_presses(recording.frames)
    if not wanted or not set(wanted) <= set(known.tolist()):
        unknown = sorted(set(wanted) - set(known.tolist()))
        asked = f"has no press {', '.join(map(str, unknown))}" if unknown else "no press was chosen"
        raise UserError(f"presses: {asked}; choose from {known.min()} to {known.max()}")
    history = recording.frames.history
    chosen = np.isin(history.press, wanted)
    after = np.flatnonzero((history.phase == Phase.REST) & (np.arange(len(history)) > np.flatnonzero(chosen).max()))
    chosen[after[:1]] = True
    return replace(recording, frames=recording.frames[chosen])


def made_presses(frames: Frames) -> NDArray[np.int64]:
    """Numbers of the presses in which something touched the skin, in order."""
    return np.unique(frames.history.press[frames.history.touched.any(axis=1)])
