"""The forward model in the coordinates the yardsticks work in, and the tables they make from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ertskin.data.synthesis import Forward
from ertskin.evaluation.yardsticks.yardstick import Array
from ertskin.physics.protocol import Protocol

Indices = NDArray[np.intp]


class Response:
    """Whitened changes in volt, touched minus rest, for forces on the taxels ``taxel_m`` (n,2)."""

    def __init__(self, forward: Forward, protocol: Protocol, taxel_m: Array):
        self.forward, self.protocol, self.taxel_m = forward, protocol, taxel_m

    def change_v(self, taxel: Indices, force_n: Array) -> Array:
        """(N,P) volt for forces ``force_n`` (N,C) on the taxels numbered ``taxel`` (N,C)."""
        return self.protocol.whitened(self.forward.change_ohm(self.taxel_m[taxel], force_n))

    def table_v(self, level_n: Array) -> Array:
        """(n,F,P) volt: every taxel alone at every force level ``level_n`` (F,)."""
        taxel, force_n = np.meshgrid(np.arange(len(self.taxel_m)), level_n, indexing="ij")
        changes_v = self.change_v(taxel.reshape(-1, 1), force_n.reshape(-1, 1))
        return changes_v.reshape(len(self.taxel_m), len(level_n), -1)


def interpolant(level_n: Array, table_v: Array) -> CubicSpline:
    """Spline in force through a table (n,F,P) and through no change at 0 N; called with (F',) it gives (F',n,P)."""
    with_rest = np.concatenate([np.zeros_like(table_v[:, :1]), table_v], axis=1)
    return CubicSpline(np.concatenate([[0.0], level_n]), np.moveaxis(with_rest, 1, 0), axis=0)
