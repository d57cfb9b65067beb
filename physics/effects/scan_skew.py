"""The press moves while it is scanned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, Effect, Stage, parameter
from physics.history import History, Phase


@dataclass(frozen=True)
class ScanSkew(Effect):
    """While loading or unloading the stage goes on at ``speed_m_per_s`` from the commanded depth during the scan.

    It never goes beyond the press's deepest command nor above the surface.
    """

    name: ClassVar[str] = "scan_skew"
    stage: ClassVar[Stage] = Stage.ACQUISITION
    source: ClassVar[str] = "A multiplexed scan takes longer than the press stands still; clock skew in tomography"

    speed_m_per_s: float = parameter("m/s", 0.0, 0.02, 0.0, 1e-4, "how fast the stage moves during the scan")

    def depth_m(self, history: History, after_s: Array) -> Array:
        """(T,S,P) depth in metre at ``after_s`` (S,) into every scan."""
        direction = np.where(history.phase == Phase.LOADING, 1.0, 0.0)
        direction = np.where(history.phase == Phase.UNLOADING, -1.0, direction)
        moved = history.depth_m[:, None, :] + self.speed_m_per_s * direction[:, None, None] * after_s[:, None]
        return np.clip(moved, 0.0, deepest_m(history)[:, None, :])


def deepest_m(history: History) -> Array:
    """(T,P) deepest commanded depth of the press each frame belongs to, NaN where there is none."""
    deepest = np.full(history.depth_m.shape, np.nan)
    for press in np.unique(history.press):
        rows = history.press == press
        depth = np.where(np.isfinite(history.depth_m[rows]), history.depth_m[rows], -np.inf).max(axis=0)
        deepest[rows] = np.where(np.isfinite(depth), depth, np.nan)
    return deepest
