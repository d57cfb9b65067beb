"""What lies on the virtual bench, and the indenter above it: the instruments' common truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.skin import Skin

Array = NDArray[np.float64]


class Mover(Protocol):
    """A stage as the world sees it."""

    def path_m(self, since_s: float, until_s: float) -> list[tuple[float, Array]]:
        """Where the indenter was: (time, position (3,)) at every turn of its path in between and at its end."""
        ...


@dataclass(frozen=True)
class Block:
    """A rigid block on the bench: the indenter's support is all that yields on it."""

    place_m: tuple[float, float]
    stiffness_n_per_m: float
    radius_m: float = 0.01


class Pair(Protocol):
    """A specimen of the piezoresistive pair as the world sees it."""

    def resistance_ohm_sq(self, time_s: float, stress_pa: float) -> float:
        """Sheet resistance under a stress; calls come in time order."""
        ...


@dataclass(frozen=True)
class SpecimenPlace:
    """A specimen between plates on the bench, its two ends wired to one of the reader's injections."""

    place_m: tuple[float, float]
    pair: Pair
    area_m2: float
    stiffness_n_per_m: float
    reading: tuple[int, int]
    radius_m: float = 0.01


class World:
    """A skin at ``origin_m`` (x, y, z of its corner's surface, in the stage's frame), perhaps a block, one indenter.

    ``specimen_wired``: the reader is wired to the specimen instead of the skin.
    """

    def __init__(
        self,
        skin: Skin,
        origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        block: Block | None = None,
        specimen: SpecimenPlace | None = None,
        force_noise_n: float = 0.0,
        seed: int = 0,
    ) -> None:
        """``force_noise_n``: the load cell's, on top of what the skin's own force has."""
        self.skin = skin
        self.mover: Mover | None = None
        self.pressed_n = 0.0
        self._origin_m = np.array(origin_m)
        self._block = block
        self._specimen = specimen
        self._resistance_ohm_sq = 0.0
        self.specimen_wired = False
        self._force_noise_n = force_noise_n
        self._rng = np.random.default_rng(seed)
        self._time_s = 0.0

    def force_n(self, time_s: float) -> float:
        """The load cell's reading."""
        self._advance(time_s)
        return self.pressed_n + self._force_noise_n * float(self._rng.normal())

    def depth_m(self, time_s: float) -> float:
        """How deep below the skin's surface the indenter is; negative in the air."""
        if self.mover is None:
            return -np.inf
        return float(self._origin_m[2] - self.mover.path_m(time_s, time_s)[-1][1][2])

    def lay(self, time_s: float, contact_m: Array | None, force_n: float = 0.0) -> None:
        """Somebody lays weights on the skin, or with None takes them off."""
        self._advance(time_s)
        self.skin.lay(time_s, contact_m, force_n)

    def scan(self, time_s: float) -> Array:
        """(K,M) volt of a scan that starts at ``time_s``."""
        self._advance(time_s)
        if self._specimen is None or not self.specimen_wired:
            return self.skin.scan(time_s)
        injection, reading = self._specimen.reading
        voltage = np.zeros(self.skin.protocol.shape)
        current = np.abs(self.skin.protocol.injection_current_a[injection]).max()
        voltage[injection, reading] = current * self._resistance_ohm_sq
        return voltage

    def _advance(self, time_s: float) -> None:
        if self.mover is None or time_s < self._time_s:
            return
        for turn_s, position_m in self.mover.path_m(self._time_s, time_s):
            self.pressed_n = self._press(turn_s, position_m - self._origin_m)
        self._time_s = time_s

    def _press(self, time_s: float, position_m: Array) -> float:
        depth_m = -float(position_m[2])
        for thing in (self._block, self._specimen):
            if thing is not None and np.hypot(*(position_m[:2] - np.array(thing.place_m))) < thing.radius_m:
                self.skin.advance(time_s, None, 0.0)
                force = thing.stiffness_n_per_m * max(0.0, depth_m)
                if isinstance(thing, SpecimenPlace):
                    self._resistance_ohm_sq = thing.pair.resistance_ohm_sq(time_s, force / thing.area_m2)
                return force
        return self.skin.advance(time_s, position_m[:2], depth_m)
