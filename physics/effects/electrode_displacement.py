"""An electrode isn't where the drawing says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import numpy as np

from ertskin.physics.effects.effect import Array, ElectrodeEffect, Start, parameter
from ertskin.physics.effects.hypothesis import Axis, Hypothesis, Measured, Signal
from ertskin.physics.effects.standard import Standard
from ertskin.physics.protocol import Protocol
from ertskin.physics.rim import moved_along
from ertskin.physics.sensor import Sensor

PULLED = 0.5
"""Part of an electrode's shift that its neighbours make, where fits begin."""


@dataclass(frozen=True)
class ElectrodeDisplacement(ElectrodeEffect):
    """Electrode number ``electrode`` sits (dx, dy) from its nominal place, or ``along_m`` from it where electrodes are
    stretches of the sheet's rim, positive in the order of the outline.

    Those sewn next to it, by their numbers the ``next_to`` it, may be pulled along by the part ``pulled`` of its shift:
    the second of them where ``side`` is 1, the first where it is -1, both where it is 0. Where none are given they are
    the one before and the one that follows; the first follows the last.
    """

    name: ClassVar[str] = "electrode_displacement"
    source: ClassVar[str] = (
        "Sewing tolerance; shape derivative as in Dardé et al., SIAM J. Imaging Sci. 5 (2012) 649; how a thread's pull"
        " falls from stitch to stitch: Euler's capstan formula (1769)"
    )
    hypothesis: ClassVar[Hypothesis] = Hypothesis(
        (Axis.ELECTRODE,), (Signal.READINGS, Signal.REST), (), measured=Measured.PAD_SHIFT
    )

    electrode: int = 0
    dx_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along x")
    dy_m: float = parameter("m", -0.01, 0.01, 0.0, 2e-4, "shift along y")
    along_m: float = parameter("m", -0.02, 0.02, 0.0, 2e-4, "shift along the sheet's rim")
    pulled: float = parameter("1", 0.0, 0.95, 0.0, 0.1, "part of its shift that its neighbours make", defining=False)

    side: int = 0
    next_to: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side not in (-1, 0, 1):
            raise ValueError(f"electrode_displacement.side = {self.side!r}: -1, 0 or 1")
        if len(self.next_to) not in (0, 2):
            raise ValueError(f"electrode_displacement.next_to: {len(self.next_to)} electrodes, two are asked for")

    def geometry(self, sensor: Sensor) -> Sensor:
        share = self._shares(sensor.electrodes)
        if sensor.electrode_edge_m is not None:
            if self.dx_m or self.dy_m:
                raise ValueError("electrode_displacement: electrodes on the sheet's rim move along it, by along_m")
            edge = moved_along(sensor.outline_m, sensor.electrode_edge_m, share * self.along_m)
            return replace(sensor, electrode_edge_m=edge) if self.along_m else sensor
        if self.along_m:
            raise ValueError("electrode_displacement: pads inside the sheet move by dx_m and dy_m, not along_m")
        center = np.array(sensor.electrode_center_m, dtype=float)
        return replace(sensor, electrode_center_m=center + share[:, None] * (self.dx_m, self.dy_m))

    def _shares(self, electrodes: int) -> Array:
        """(L,) part of the shift that each electrode makes."""
        share = np.zeros(electrodes)
        first, second = self.next_to or (self.electrode - 1, self.electrode + 1)
        pulled = {1: [second], -1: [first], 0: [first, second]}[self.side]
        share[np.array(pulled) % electrodes] = self.pulled
        share[self.electrode] = 1.0
        return share

    def quantities(self, standard: Standard) -> dict[str, float]:
        """Where the electrode lies, from its place, in the middle of a stretch of the rim."""
        if standard.sensor is None or standard.sensor.electrode_edge_m is None:
            return {}
        moved = self.geometry(standard.sensor).electrode_edge_m
        assert moved is not None
        dx_m, dy_m = (moved - standard.sensor.electrode_edge_m)[self.electrode].mean(axis=0).tolist()
        return {"dx_m": dx_m, "dy_m": dy_m}

    @classmethod
    def reading_starts(cls, sensor: Sensor, protocol: Protocol) -> tuple[Start, ...]:
        """Every electrode alone, then every one with its neighbours, inside the sheet any two of the nearest."""
        inside = sensor.electrode_edge_m is None
        ways = ("dx_m", "dy_m") if inside else ("along_m",)
        nearest = [_nearest(sensor, electrode) if inside else [()] for electrode in range(sensor.electrodes)]
        alone = [cls(electrode, next_to=pairs[0]) for electrode, pairs in enumerate(nearest)]
        pulling = [replace(one, next_to=pads, pulled=PULLED) for one in alone for pads in nearest[one.electrode]]
        return tuple(Start(one, ways, ways) for one in (*alone, *pulling))

    def freer(self, free: tuple[str, ...]) -> tuple[Start, ...]:
        """With neighbours that one thread pulls along."""
        if "pulled" in free:
            return ()
        return tuple(Start(replace(self, pulled=PULLED, side=side), (*free, "pulled")) for side in (1, -1, 0))


def _nearest(sensor: Sensor, electrode: int) -> list[tuple[int, ...]]:
    """Numbers of the two pads nearest to one, in every way where some are equally near; none where there aren't two."""
    far_m = np.round(np.linalg.norm(sensor.electrode_middle_m - sensor.electrode_middle_m[electrode], axis=1), 5)
    others = [pad for pad in np.argsort(far_m, kind="stable").tolist() if pad != electrode]
    if len(others) < 2:
        return [()]
    second_m = far_m[others[1]]
    near = [pad for pad in others if far_m[pad] <= second_m]
    nearer = {pad for pad in near if far_m[pad] < second_m}
    return [pair for pair in combinations(sorted(near), 2) if nearer <= set(pair)]
