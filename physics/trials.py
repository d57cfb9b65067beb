"""Which presses to simulate: the trials of the paper (IV-B), each drawn from its own seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trials:
    """N presses with up to C contacts each: ``taxel`` (N,C) indices, ``contact_m`` (N,C,2), ``force_n`` (N,C).

    An absent contact has NaN for place and force.
    """

    taxel: NDArray[np.intp]
    contact_m: Array
    force_n: Array

    def __len__(self) -> int:
        return len(self.taxel)

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> Trials:
        """The presses selected."""
        return Trials(self.taxel[rows], self.contact_m[rows], self.force_n[rows])

    def force_map_n(self, taxels: int) -> Array:
        """(N, taxels) newton on every taxel."""
        label = np.zeros((len(self), taxels))
        np.add.at(label, (np.arange(len(self))[:, None], self.taxel), np.nan_to_num(self.force_n))
        return label


def one_point(taxel_m: Array, steps: int = 100, max_force_n: float = 10.0) -> Trials:
    """Every taxel pressed with ``steps`` equal steps of force up to ``max_force_n``: 36 x 100 = 3600 in the paper."""
    force = max_force_n * np.arange(1, steps + 1) / steps
    taxel = np.repeat(np.arange(len(taxel_m)), steps)[:, None]
    return Trials(taxel, taxel_m[taxel], np.tile(force, len(taxel_m))[:, None])


def many_point(
    taxel_m: Array,
    trials: int,
    *,
    contacts: int = 2,
    min_force_n: float = 0.1,
    max_force_n: float = 10.0,
    jitter_m: float = 0.0,
    seed: int = 0,
    first: int = 0,
) -> Trials:
    """``trials`` presses on ``contacts`` different taxels with independent uniform forces, numbers ``first`` and on.

    Trial k depends on ``seed`` and k alone, so any split into shards gives the same set. ``jitter_m``: contacts land
    normally distributed about the taxel's centre with this standard deviation. Raises ``ValueError`` where there are
    fewer taxels than contacts.
    """
    if contacts > len(taxel_m):
        raise ValueError(f"{contacts} contacts need as many taxels, the grid has {len(taxel_m)}")
    drawn = [_draw(np.random.default_rng((seed, contacts, first + k)), taxel_m, contacts) for k in range(trials)]
    taxel = np.array([d[0] for d in drawn], dtype=np.intp).reshape(trials, contacts)
    share = np.array([d[1] for d in drawn]).reshape(trials, contacts)
    offset = np.array([d[2] for d in drawn]).reshape(trials, contacts, 2)
    force = min_force_n + (max_force_n - min_force_n) * share
    return Trials(taxel, taxel_m[taxel] + jitter_m * offset, force)


def _draw(rng: np.random.Generator, taxel_m: Array, contacts: int) -> tuple[NDArray[np.intp], Array, Array]:
    taxel = rng.choice(len(taxel_m), contacts, replace=False)
    return taxel, rng.random(contacts), rng.standard_normal((contacts, 2))
