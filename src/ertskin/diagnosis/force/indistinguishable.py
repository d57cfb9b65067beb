"""Effects that a recording's presses can't tell apart, whatever their forms fit."""

from __future__ import annotations

import numpy as np

from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Need
from ertskin.physics.history import History, Phase


def distinguishable(one: Effect, other: Effect, history: History) -> bool:
    """Whether the presses of ``history`` can tell two effects from one another.

    Two that push back less on the way out differ only on a second way in at the same place.
    """
    return not all(Need.RELOADING in effect.hypothesis.needs for effect in (one, other)) or reloaded(history)


def reloaded(history: History) -> bool:
    """Whether the pad is loaded again somewhere: in another press of the same place, or within a press."""
    place = history.spot[:, 0]
    touched = history.touched[:, 0] & (place >= 0)
    presses = np.unique(np.stack([place[touched], history.press[touched]], axis=1), axis=0)
    if len(np.unique(presses[:, 0])) < len(presses):
        return True
    same = history.press[1:] == history.press[:-1]
    return bool((same & (history.phase[:-1] == Phase.UNLOADING) & (history.phase[1:] == Phase.LOADING)).any())
