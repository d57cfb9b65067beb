"""What no effect of foam or stage explains of forces: a load cell that drifts, a pad that differs by place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.history import History

Array = NDArray[np.float64]

KNOTS = 12
"""Of a drift over the recording, straight in between."""
SIZES = 2.0 ** np.arange(-3, 6)
"""Standard deviations that are tried, over the noise."""


@dataclass(frozen=True, eq=False)
class Remainder:
    """Forces nobody can predict: ``design`` (n,k) times standard normal numbers, in units of the noise, white noise
    beside them."""

    name: str
    design: Array

    def whitened(self, residual: Array) -> Array:
        """(n,) the residual (n,) with what this explains weighed down to white noise."""
        along, size, _ = np.linalg.svd(self.design, full_matrices=False)
        return np.asarray(residual - along @ ((1 - 1 / np.sqrt(1 + size**2)) * (along.T @ residual)))

    def log_evidence(self, residual: Array) -> float:
        """Logarithm of the residual's (n,) probability over what white noise alone gives it."""
        along, size, _ = np.linalg.svd(self.design, full_matrices=False)
        explained = (along.T @ residual) ** 2 * size**2 / (1 + size**2)
        return 0.5 * float(explained.sum() - np.log1p(size**2).sum())

    def rows(self, chosen: NDArray[np.bool_]) -> Remainder:
        """Of the frames ``chosen`` (n,) alone."""
        return Remainder(self.name, self.design[chosen])


def likeliest(history: History, used: NDArray[np.bool_], force_n: Array, residual: Array) -> tuple[Remainder, float]:
    """The remainder that explains a residual (n,) of the contacts ``used`` (T,C) best, and its log evidence.

    ``force_n`` (n,) are the forces that were to be explained.
    """
    scored = [(one, one.log_evidence(residual)) for one in _remainders(history, used, force_n)]
    return max(scored, key=lambda pair: pair[1])


def _remainders(history: History, used: NDArray[np.bool_], force_n: Array) -> Iterator[Remainder]:
    time_s = np.broadcast_to(history.time_s[:, None], used.shape)[used]
    knots = np.linspace(time_s.min(), time_s.max() + 1e-9, KNOTS)
    hats = np.stack([np.interp(time_s, knots, one) for one in np.eye(KNOTS)], axis=1)
    place = history.spot[used]
    places = (place[:, None] == np.unique(place)[None, :]).astype(float)
    share = force_n[:, None] / np.sqrt(np.mean(force_n**2))
    kinds = {
        "a load cell whose zero drifts": hats,
        "a load cell whose gain drifts": share * hats,
        "a pad that differs from place to place": share * places,
    }
    for name, design in kinds.items():
        for size in SIZES:
            yield Remainder(name, size * design)
