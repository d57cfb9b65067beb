"""Terms of a fit: effects with the numbers that may move, smooth fields by their modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.smooth_field import Nodes, field_design

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Modes:
    """Fields over the sheet by their ``nodes`` (K,rows,columns): sums of them in which each has unit variance, and no
    mean, are what is expected of a field beforehand. They are the larger part of a process, of standard deviation
    ``spread``: ``half`` (M,J) is half of its covariance, of unit variance; both before its mean over the nodes is taken
    off, where the effect has none. ``by_place``: of what places pressed differ by alone, which tells of no other
    place."""

    nodes: Array
    half: Array = field(default_factory=lambda: np.zeros((1, 0)))
    spread: float = 0.0
    by_place: bool = False

    def of(self, sizes: Sequence[float]) -> Nodes:
        """Node values of the sum in which the modes have these ``sizes`` (K,)."""
        return tuple(tuple(map(float, row)) for row in np.tensordot(np.asarray(sizes), self.nodes, 1))

    def __call__(self, position_m: Array, extent_m: Array) -> Array:
        """(N,K) the modes at positions (N,2) of a sheet with the box ``extent_m`` (2,2)."""
        count, *shape = self.nodes.shape
        return np.asarray(field_design((shape[0], shape[1]), position_m, extent_m) @ self.nodes.reshape(count, -1).T)


@dataclass(frozen=True)
class Term:
    """An effect in a fit: where it starts and which parameters may move.

    A smooth field moves in its ``modes``, of which it has ``sizes`` (K,).
    """

    effect: Effect
    free: tuple[str, ...]
    modes: Modes | None = None
    sizes: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def by_place(self) -> bool:
        """Whether it is a field told place by place."""
        return self.modes is not None and self.modes.by_place

    @property
    def count(self) -> int:
        """How many numbers may move."""
        return len(self.free) + len(self.sizes)

    @property
    def start(self) -> list[float]:
        """The numbers that may move, where they are."""
        return [*map(self.effect.value, self.free), *self.sizes]

    def nearer(self, share: float) -> Term:
        """The term where only this share of it is there."""
        known = {key: self.effect.known(key) for key in self.free}
        defining = {key: self.effect.value(key) for key in self.free if known[key].defining}
        values: dict[str, Any] = {
            key: known[key].neutral + share * (value - known[key].neutral) for key, value in defining.items()
        }
        if nodes := getattr(self.effect, "nodes", ()):
            values["nodes"] = tuple(tuple(share * value for value in row) for row in nodes)
        return replace(self, effect=self.effect.changed(values), sizes=tuple(share * size for size in self.sizes))

    def at(self, numbers: Sequence[float]) -> Term:
        """The term with the numbers that may move at these values."""
        values: dict[str, Any] = dict(zip(self.free, map(float, numbers), strict=False))
        sizes = tuple(map(float, numbers[len(self.free) :]))
        if self.modes is not None:
            values["nodes"] = self.modes.of(sizes)
        return replace(self, effect=self.effect.changed(values), sizes=sizes)
