"""A skin as it really is: sheet, pad, law, contacts, plan, protocol, noise. Effects come on top."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .layered import Layer
from .protocol import Plan, Protocol
from .sheet import Electrodes, Fineness

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Law:
    """Sheet resistance over its unloaded value: a fifth-order polynomial up to ``top_pa``, constant beyond."""

    coefficients: Array
    top_pa: float

    def log_gain(self, pressure_pa: Array) -> Array:
        """Logarithm of conductance over that at rest."""
        share = np.clip(pressure_pa / self.top_pa, 0.0, 1.0)
        return np.asarray(-np.log(np.polynomial.polynomial.polyval(share, self.coefficients)))


def law_of(rng: np.random.Generator, top_pa: float) -> Law:
    """A falling polynomial close to a power law of contacts in parallel (Greenwood and Williamson 1966: G ~ p)."""
    share = np.linspace(0.0, 1.0, 201)
    for _ in range(100):
        half, floor = rng.uniform(0.12, 0.3), rng.uniform(0.05, 0.25)
        wanted = floor + (1.0 - floor) / (1.0 + share / half) ** rng.uniform(1.0, 1.4)
        rising = share[:, None] ** np.arange(1, 6)
        fitted = np.linalg.lstsq(rising, wanted - 1.0, rcond=None)[0]
        coefficients = np.concatenate([[1.0], fitted])
        if (np.diff(np.polynomial.polynomial.polyval(share, coefficients)) < 0).all():
            return Law(coefficients, top_pa)
    raise ValueError("no falling polynomial among a hundred drawn")


@dataclass(frozen=True, eq=False)
class Noise:
    """Reading noise (V), the share of its variance that is slow, load cell (N), specimen (a fraction)."""

    white_v: float = 2e-3
    coloured_share: float = 0.0
    force_n: float = 0.01
    specimen: float = 1e-3


@dataclass(frozen=True, eq=False)
class Skin:
    """Everything true of one skin but its effects. ``said`` is what its maker says where that is something else."""

    seed: int
    outline_m: Array
    electrodes: Electrodes
    layers: tuple[Layer, ...]
    interface: int
    diameter_m: float
    points_m: Array
    margin_m: float
    sheet_ohm: float
    contact_ohm: Array
    support_n_per_m: float
    law: Law
    taxel_m: Array
    protocol: Protocol
    plan: Plan
    noise: Noise
    said: dict[str, float] = field(default_factory=dict)
    fineness: Fineness = field(default_factory=lambda: Fineness(2.6e-3, 4.5e-4))

    @property
    def box_m(self) -> Array:
        """(2,2) corners of the sheet's bounding box."""
        return np.array([self.outline_m.min(axis=0), self.outline_m.max(axis=0)])
