"""Which currents go in, which potentials are read, and the plan of presses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Protocol:
    """Injections of a pair of electrodes each, and what is read in each.

    ``injection`` (K,2) source and sink; ``read`` ``None`` for every electrode against the sink, else (M,2) or (K,M,2)
    pairs; ``measured`` (K,M) readings that the instrument takes, all without it.
    """

    electrodes: int
    injection: Indices
    current_a: float
    scan_s: float
    read: Indices | None = None
    measured: NDArray[np.bool_] | None = None
    adc_volts_per_count: float = 10.0 / 65536
    adc_limit_v: float = 10.0

    @property
    def offset_s(self) -> Array:
        """(K,) when each injection is read, after the frame's time."""
        return np.asarray(self.scan_s * np.arange(len(self.injection)) / len(self.injection))

    @property
    def current(self) -> Array:
        """(K,L) ampere into each electrode."""
        rows = np.arange(len(self.injection))
        current = np.zeros((len(rows), self.electrodes))
        current[rows, self.injection[:, 0]] = self.current_a
        current[rows, self.injection[:, 1]] = -self.current_a
        return current

    @property
    def weights(self) -> Array:
        """(K,M,L) weights of the electrodes' potentials in each reading."""
        unit = np.eye(self.electrodes)
        if self.read is None:
            return np.asarray(unit[None] - unit[self.injection[:, 1]][:, None])
        pairs = np.broadcast_to(self.read, (len(self.injection), *self.read.shape[-2:]))
        return np.asarray(unit[pairs[..., 0]] - unit[pairs[..., 1]])

    def readings(self, transfer_ohm: Array) -> Array:
        """(K,M) volts for one (L,L) or for the (K,L,L) transfer matrices met by the injections."""
        if transfer_ohm.ndim == 2:
            potential = self.current @ transfer_ohm
        else:
            potential = np.einsum("kl,klm->km", self.current, transfer_ohm)
        return np.asarray(np.einsum("kml,kl->km", self.weights, potential))


def all_pairs(electrodes: int, current_a: float, scan_s: float, step: int = 1) -> Protocol:
    """Every pair injected (every ``step``-th of them), all electrodes read against the sink."""
    pairs = np.stack(np.triu_indices(electrodes, 1), axis=1)
    return Protocol(electrodes, pairs[:: max(step, 1)], current_a, scan_s)


def adjacent(electrodes: int, current_a: float, scan_s: float) -> Protocol:
    """Neighbours injected, neighbours read where neither is driven: 16 electrodes give 16 x 13 = 208 readings."""
    ring = np.stack([np.arange(electrodes), (np.arange(electrodes) + 1) % electrodes], axis=1)
    driven = (ring[:, None, :, None] == ring[None, :, None, :]).any(axis=(2, 3))
    return Protocol(electrodes, ring, current_a, scan_s, read=ring, measured=~driven)


def spread(electrodes: int, injections: int, current_a: float, scan_s: float, rng: np.random.Generator) -> Protocol:
    """A sparse scan: a ring of injections across the sheet and random ones; driven electrodes aren't read."""
    half = np.arange(electrodes)
    ring = np.sort(np.stack([half, (half + electrodes // 3) % electrodes], axis=1), axis=1)
    every = np.stack(np.triu_indices(electrodes, 1), axis=1)
    chosen = np.unique(np.concatenate([ring, every[rng.permutation(len(every))[:injections]]]), axis=0)
    return Protocol(electrodes, chosen, current_a, scan_s)


@dataclass(frozen=True, eq=False)
class Press:
    """One press: places (P,2), depths on the way in (n,), how often and how far apart it is seen while held."""

    position_m: Array
    depth_m: Array
    step_s: float
    held: int
    hold_s: float
    gap_s: float

    @property
    def lasts_s(self) -> float:
        """From the rest frame before it to its last frame under load."""
        return self.step_s * (2 * len(self.depth_m) - 1) + self.held * self.hold_s


@dataclass(frozen=True, eq=False)
class Plan:
    """Presses in order."""

    presses: tuple[Press, ...]

    @property
    def duration_s(self) -> float:
        """From the first rest frame to the last."""
        return sum(p.lasts_s + p.gap_s for p in self.presses)


def plan_of(
    rng: np.random.Generator, places_m: Array, count: int, deepest_m: float, levels: int, repeats: float = 0.2
) -> Plan:
    """Presses at places in random order, a share of them again at a place pressed before, at two speeds."""
    order = [places_m[i] for i in _spread_order(rng, len(places_m), count)]
    presses: list[Press] = []
    for number in range(count):
        again = number > 1 and rng.random() < repeats
        place = presses[int(rng.integers(number))].position_m[0] if again else order[number]
        deepest = deepest_m * float(rng.choice([0.7, 0.85, 1.0, 1.0]))
        step = float(rng.choice([0.5, 1.0]))
        held, hold = int(rng.integers(2, 4)), float(rng.choice([3.0, 6.0]))
        depth = np.round(deepest * np.arange(1, levels + 1) / levels, 6)
        presses.append(Press(np.array([place]), depth, step, held, hold, 10.0))
    return Plan(tuple(presses))


def _spread_order(rng: np.random.Generator, places: int, count: int) -> list[int]:
    order: list[int] = []
    while len(order) < count:
        order += rng.permutation(places).tolist()
    return order[:count]
