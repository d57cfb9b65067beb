"""The bench's stage and foam in time: commanded depths become forces within every scan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hardware.virtual.bench.foam import BoucWen, Foam, FoamSpot, Hyperfoam, Mullins, Prony
from hardware.virtual.bench.truth import Truth

Array = NDArray[np.float64]

MOVE_S = 0.1
"""The stage moves from step to step in this time and stands still when the scan starts."""

SAME_PLACE_M = 3e-3


class Indenter:
    """One indenter on one foam: ``settle`` it at a depth, ask for the force during the scan that follows."""

    def __init__(self, truth: Truth, stiffness_n_per_m: float, scan_s: float) -> None:
        given = truth.parameters
        hyper, prony, loss, soft = (
            given(name) for name in ("nonlinear_foam", "viscoelastic_foam", "foam_hysteresis", "foam_softening")
        )
        self.foam = Foam(
            stiffness_n_per_m,
            truth.support_n_per_m,
            Hyperfoam(**hyper) if hyper else Hyperfoam(),
            Prony(tuple(prony["shares"]), tuple(prony["times_s"])) if prony else Prony(),
            BoucWen(**loss) if loss else BoucWen(),
            Mullins(**soft) if soft else Mullins(),
        )
        lag, play = given("scan_skew"), given("stage_backlash")
        self._lag_s = lag["settle_s"] if lag else 0.0
        self._play_m = play["play_m"] if play else 0.0
        self.instants_s = np.linspace(0.0, scan_s, 9 if self._lag_s > 0.0 else 3)
        self._spots: list[tuple[Array, FoamSpot]] = []
        self._place: Array | None = None
        self._now_s = 0.0
        self._from_m = self._carriage_m = 0.0

    @property
    def spot(self) -> FoamSpot | None:
        """The foam under the indenter, ``None`` in air."""
        return None if self._place is None else self._find(self._place)

    def _find(self, place_m: Array) -> FoamSpot:
        for where, spot in self._spots:
            if np.hypot(*(where - place_m)) < SAME_PLACE_M:
                return spot
        spot = FoamSpot(self.foam)
        self._spots.append((place_m, spot))
        return spot

    def lift(self, time_s: float) -> None:
        """Into the air, starting at ``time_s``."""
        spot = self.spot
        if spot is not None:
            spot.press(self._carriage_m, max(time_s - self._now_s, 0.0))
            spot.press(0.0, MOVE_S)
            self._now_s = time_s + MOVE_S
        self._place, self._from_m, self._carriage_m = None, 0.0, 0.0

    def settle(self, place_m: Array, depth_m: float, time_s: float) -> Array:
        """(S,) force in newton at ``instants_s`` of the scan at ``time_s``, pressed to ``depth_m`` just before."""
        if self._place is None or np.hypot(*(self._place - place_m)) >= SAME_PLACE_M:
            self.lift(self._now_s)
            self._place = place_m
            self._find(place_m).press(0.0, max(time_s - MOVE_S - self._now_s, 1.0))
        else:
            self._find(place_m).press(self._carriage_m, max(time_s - MOVE_S - self._now_s, 0.0))
        self._now_s = time_s - MOVE_S
        start, self._from_m = self._carriage_m, depth_m
        goal = max(depth_m, min(start, depth_m + self._play_m))
        return np.array([self._move(start, goal, time_s, instant) for instant in self.instants_s])

    def _move(self, start_m: float, goal_m: float, time_s: float, instant_s: float) -> float:
        since = MOVE_S + instant_s
        left = np.exp(-since / self._lag_s) if self._lag_s > 0.0 else 0.0
        self._carriage_m = goal_m + (start_m - goal_m) * left
        spot = self.spot
        if spot is None:
            raise RuntimeError("the indenter is in the air")
        force = spot.press(self._carriage_m, time_s + instant_s - self._now_s)
        self._now_s = time_s + instant_s
        return force


def lagrange(nodes: Array, points: Array) -> Array:
    """(len(points), len(nodes)) weights of polynomial interpolation through distinct nodes."""

    def columns() -> Iterator[Array]:
        for number, node in enumerate(nodes):
            others = np.delete(nodes, number)
            yield np.prod((points[:, None] - others) / (node - others), axis=1)

    return np.stack(list(columns()), axis=1)
