"""The press moves while it is scanned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, MotionEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Need, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class ScanSkew(MotionEffect):
    """While loading or unloading the stage moves at ``speed_m_per_s``, at the commanded depth ``at_s`` into the scan.

    At 0 it goes on from the command, at the scan's end it arrives there, between the scan sees it come and go. It never
    goes above the surface, nor beyond the press's deepest command unless it ``overshoots``. With ``ease`` it sets out
    and arrives more gently, within the scan, than at constant speed. Where a recorder interpolates between two scans
    readings run ``straight`` from one to the other.
    """

    name: ClassVar[str] = "scan_skew"
    source: ClassVar[str] = "A multiplexed scan takes longer than the press stands still; clock skew in tomography"
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.SCAN_ORDER, Axis.HISTORY),
        (Signal.NONRECIPROCAL, Signal.READINGS, Signal.FORCE),
        (Need.PRESSES, Need.MORE_READINGS, Need.TIMED_INJECTIONS),
        held=frozenset({"at_s", "ease"}),
    )

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

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """At the commanded depth when the scan begins, halfway through it, and when it ends."""
        if not protocol.timed:
            return ()
        last_s = float(np.max(np.asarray(protocol.injection_offset_s)))
        speed = cls.parameters()["speed_m_per_s"].typical
        free = ("speed_m_per_s", "at_s")
        return tuple(Start(cls(speed, at_s), free, ("speed_m_per_s",)) for at_s in (0.0, 0.5 * last_s, last_s))

    @classmethod
    def force_starts(cls) -> tuple[Start, ...]:
        """On its way to the next depth from the scan's beginning on: a mean force tells no more than how far ahead the
        stage is on average. Behind it may be for play alone, which is no motion."""
        return (Start(cls(cls.parameters()["speed_m_per_s"].typical), ("speed_m_per_s",)),)

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Part of the way to the next depth that is made while a scan is taken."""
        return {"share_of_step_in_scan": min(self.speed_m_per_s * standard.scan_s / standard.step_m, 1.0)}

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        # Easing comes to the same ends, which are all that straight readings hang on.
        ends = tuple(key for key in free if key != "ease")
        straight = replace(self, straight=True, ease=0.0)
        if self.straight:
            return () if self.overshoots else (Start(replace(straight, overshoots=True), ends),)
        if "ease" in free:
            return (Start(straight, ends),)
        eased = replace(self, ease=0.5)
        forms = eased, replace(eased, overshoots=True)
        return Start(straight, ends), *(Start(form, (*free, "ease")) for form in forms)

    @property
    def moves(self) -> bool:
        return self.speed_m_per_s > 0

    def at_speed(self, speed_m_per_s: float) -> ScanSkew:
        return replace(self, speed_m_per_s=min(speed_m_per_s, self.parameters()["speed_m_per_s"].high))


def deepest_m(history: History) -> Array:
    """(T,P) deepest commanded depth of the press each frame belongs to, NaN where there is none."""
    deepest = np.full(history.depth_m.shape, np.nan)
    for press in np.unique(history.press):
        rows = history.press == press
        depth = np.where(np.isfinite(history.depth_m[rows]), history.depth_m[rows], -np.inf).max(axis=0)
        deepest[rows] = np.where(np.isfinite(depth), depth, np.nan)
    return deepest
