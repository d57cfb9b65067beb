"""The press moves while it is scanned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from physics.effects.effect import Array, Effect, Stage, parameter
from physics.history import History, Phase


@dataclass(frozen=True)
class ScanSkew(Effect):
    """While loading or unloading the stage moves at ``speed_m_per_s``, at the commanded depth ``at_s`` into the scan.

    At 0 it goes on from the command, at the scan's end it arrives there, between the scan sees it come and go. It never
    goes above the surface, nor beyond the press's deepest command unless it ``overshoots``. With ``ease`` it sets out
    and arrives more gently, within the scan, than at constant speed.
    """

    name: ClassVar[str] = "scan_skew"
    stage: ClassVar[Stage] = Stage.ACQUISITION
    source: ClassVar[str] = "A multiplexed scan takes longer than the press stands still; clock skew in tomography"

    speed_m_per_s: float = parameter("m/s", 0.0, 0.02, 0.0, 1e-4, "how fast the stage moves during the scan")
    at_s: float = parameter("s", -5.0, 5.0, 0.0, 0.05, "moment of the scan at the commanded depth", defining=False)
    ease: float = parameter("1", 0.0, 1.0, 0.0, 0.1, "part of the way on an S, the rest at one speed", defining=False)

    overshoots: bool = False
    """Whether the stage passes the deepest command too, and comes back."""

    def depth_m(self, history: History, after_s: Array) -> Array:
        """(T,S,P) depth in metre at ``after_s`` (S,) into every scan, the first and the last of them its ends."""
        direction = np.where(history.phase == Phase.LOADING, 1.0, 0.0)
        direction = np.where(history.phase == Phase.UNLOADING, -1.0, direction)
        scan_s = float(np.ptp(after_s))
        share = (after_s - after_s.min()) / scan_s if scan_s > 0 else np.zeros(len(after_s))
        eased_s = after_s + self.ease * scan_s * (share**2 * (3 - 2 * share) - share)
        way_m = direction[:, None, None] * self.speed_m_per_s * (eased_s - self.at_s)[:, None]
        moved = np.maximum(history.depth_m[:, None, :] + way_m, 0.0)
        return moved if self.overshoots else np.minimum(moved, deepest_m(history)[:, None, :])


def deepest_m(history: History) -> Array:
    """(T,P) deepest commanded depth of the press each frame belongs to, NaN where there is none."""
    deepest = np.full(history.depth_m.shape, np.nan)
    for press in np.unique(history.press):
        rows = history.press == press
        depth = np.where(np.isfinite(history.depth_m[rows]), history.depth_m[rows], -np.inf).max(axis=0)
        deepest[rows] = np.where(np.isfinite(depth), depth, np.nan)
    return deepest
