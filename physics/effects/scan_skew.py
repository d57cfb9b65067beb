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

UNEVEN = "ease", "bend"
"""Parameters of a speed that changes during the scan."""


@dataclass(frozen=True)
class ScanSkew(MotionEffect):
    """While loading or unloading the stage moves at ``speed_m_per_s``, at the commanded depth ``at_s`` into the scan.

    At 0 it goes on from the command, at the scan's end it arrives there, between the scan sees it come and go. It never
    goes above the surface, nor beyond the press's deepest command unless it ``overshoots``. Where it goes ``by_steps``
    it makes the same part of every step from one depth to the next, long or short: the speed is that of the usual step,
    and in the last frame held it sets out already. With ``ease`` it sets out and arrives more gently, within the scan,
    than at constant speed; with ``bend`` it gathers speed during the scan, or loses it: ``at_s`` counts as at constant
    speed. Where a recorder interpolates between two scans readings run ``straight`` from one to the other.
    """

    name: ClassVar[str] = "scan_skew"
    source: ClassVar[str] = "A multiplexed scan takes longer than the press stands still; clock skew in tomography"
    # A load cell tells the mean way alone: a third of all where the stage gathers speed evenly, two where it loses it.
    form_error: ClassVar[float] = 0.3
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.SCAN_ORDER, Axis.HISTORY),
        (Signal.NONRECIPROCAL, Signal.READINGS, Signal.FORCE),
        (Need.PRESSES, Need.MORE_READINGS, Need.TIMED_INJECTIONS),
        held=frozenset({"at_s", "ease", "bend"}),
        also_in_readings=("speed_m_per_s",),
    )

    speed_m_per_s: float = parameter("m/s", 0.0, 0.02, 0.0, 1e-4, "how fast the stage moves during the scan")
    at_s: float = parameter("s", -5.0, 5.0, 0.0, 0.05, "moment of the scan at the commanded depth", defining=False)
    ease: float = parameter("1", 0.0, 1.0, 0.0, 0.1, "part of the way on an S, the rest at one speed", defining=False)
    bend: float = parameter(
        "1", -1.0, 1.0, 0.0, 0.1, "gain in speed from the middle of a scan to its end, over the mean", defining=False
    )

    overshoots: bool = False
    """Whether the stage passes the deepest command too, and comes back."""
    by_steps: bool = False
    """Whether the stage makes a part of every step, as a servo does, instead of going at one speed."""

    def depth_m(self, history: History, after_s: Array) -> Array:
        """(T,S,P) depth in metre at ``after_s`` (S,) into every scan, the first and the last of them its ends."""
        coming, going = _steps(history) if self.by_steps else (_direction(history)[:, None],) * 2
        scan_s = float(np.ptp(after_s))
        share = (after_s - after_s.min()) / scan_s if scan_s > 0 else np.zeros(len(after_s))
        uneven = self.ease * (share**2 * (3 - 2 * share) - share) + self.bend * (share**2 - share)
        late_s = (after_s + scan_s * uneven - self.at_s)[:, None]
        way_s = coming[:, None] * np.minimum(late_s, 0.0) + going[:, None] * np.maximum(late_s, 0.0)
        moved = np.maximum(history.depth_m[:, None, :] + self.speed_m_per_s * way_s, 0.0)
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
        speed = cls.parameters()["speed_m_per_s"].typical
        return tuple(Start(cls(speed, by_steps=by_steps), ("speed_m_per_s",)) for by_steps in (False, True))

    def within_scans(self, protocol: Protocol) -> ScanSkew:
        """At the commanded depth in the middle of the scan, which is its mean."""
        return replace(self, at_s=0.5 * float(np.max(np.asarray(protocol.injection_offset_s))))

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Part of the way to the next depth that is made while a scan is taken."""
        return {"share_of_step_in_scan": min(self.speed_m_per_s * standard.scan_s / standard.step_m, 1.0)}

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        # Uneven speeds come to the same ends, which are all that straight readings hang on.
        ends = tuple(key for key in free if key not in UNEVEN)
        straight = replace(self, straight=True, ease=0.0, bend=0.0)
        if self.straight:
            return () if self.overshoots else (Start(replace(straight, overshoots=True), ends),)
        if set(UNEVEN) & set(free):
            return (Start(straight, ends),)
        eased, bent = replace(self, ease=0.5), replace(self, bend=0.3, by_steps=True)
        easing = eased, replace(eased, overshoots=True), replace(eased, by_steps=True)
        forms = *((form, "ease") for form in easing), (bent, "bend")
        return Start(straight, ends), *(Start(form, (*free, key)) for form, key in forms)

    @property
    def moves(self) -> bool:
        return self.speed_m_per_s > 0

    def at_speed(self, speed_m_per_s: float) -> ScanSkew:
        return replace(self, speed_m_per_s=min(speed_m_per_s, self.parameters()["speed_m_per_s"].high))


def _direction(history: History) -> Array:
    """(T,) 1 while loading, -1 while unloading, else 0."""
    return np.select([history.phase == Phase.LOADING, history.phase == Phase.UNLOADING], [1.0, -1.0])


def _steps(history: History) -> tuple[Array, Array]:
    """(T,P) steps to the depth of every frame, and from there to the next, over the usual step; air is no depth, but
    where the stage is held it neither comes from there nor goes."""
    depth_m, within = np.nan_to_num(history.depth_m), history.press[1:] == history.press[:-1]
    air = ~history.touched.any(axis=1)
    before, after = depth_m.copy(), depth_m.copy()
    before[1:] = np.where(within[:, None], depth_m[:-1], 0.0)
    after[:-1] = np.where(within[:, None], depth_m[1:], 0.0)
    held = (history.phase == Phase.HOLD)[:, None]
    from_air, to_air = np.roll(air, 1)[:, None], np.roll(air, -1)[:, None]
    coming = np.where(held & from_air, 0.0, depth_m - before)
    going = np.where(held & to_air, 0.0, after - depth_m)
    usual_m = history.step_m if history.step_m > 0 else np.inf
    return coming / usual_m, going / usual_m


def deepest_m(history: History) -> Array:
    """(T,P) deepest commanded depth of the press each frame belongs to, NaN where there is none."""
    deepest = np.full(history.depth_m.shape, np.nan)
    for press in np.unique(history.press):
        rows = history.press == press
        depth = np.where(np.isfinite(history.depth_m[rows]), history.depth_m[rows], -np.inf).max(axis=0)
        deepest[rows] = np.where(np.isfinite(depth), depth, np.nan)
    return deepest
