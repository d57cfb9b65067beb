"""Effects that a recording's presses can't tell apart, whatever their forms fit."""

from __future__ import annotations

import numpy as np

from physics.effects.foam_hysteresis import FoamHysteresis
from physics.effects.foam_softening import FoamSoftening
from physics.history import History, Phase
from physics.mechanics.reaction import place_numbers

SHOWN_BY_RELOADING = {FoamHysteresis.name, FoamSoftening.name}
"""Both push back less on the way out; only on a second way in at the same place is one softer and the other not."""


def told_apart(one: str, other: str, history: History) -> bool:
    """Whether the presses of ``history`` can tell effects of these names from one another."""
    return not {one, other} <= SHOWN_BY_RELOADING or reloaded(history)


def reloaded(history: History) -> bool:
    """Whether the pad is loaded again somewhere: in another press of the same place, or within a press."""
    place = place_numbers(history.contact_m)[:, 0]
    touched = history.touched[:, 0] & (place >= 0)
    presses = np.unique(np.stack([place[touched], history.press[touched]], axis=1), axis=0)
    if len(np.unique(presses[:, 0])) < len(presses):
        return True
    same = history.press[1:] == history.press[:-1]
    return bool((same & (history.phase[:-1] == Phase.UNLOADING) & (history.phase[1:] == Phase.LOADING)).any())
