"""The bench's stage and foam in time: where the carriage is told to go, where it is, and how hard the foam pushes."""

from __future__ import annotations

from copy import copy, deepcopy

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.bench.foam import BoucWen, Foam, FoamSpot, Hyperfoam, Mullins, Prony
from ertskin.hardware.virtual.bench.truth import Truth

Array = NDArray[np.float64]

MOVE_S = 0.1
"""The stage of a recorded run moves from step to step in this time, just before each scan."""

SAME_PLACE_M = 3e-3


def foam_of(truth: Truth, stiffness_n_per_m: float) -> Foam:
    """The foam with everything hidden in it."""
    hyper, prony, loss, soft = (
        truth.parameters(name) for name in ("nonlinear_foam", "viscoelastic_foam", "foam_hysteresis", "foam_softening")
    )
    return Foam(
        stiffness_n_per_m,
        truth.support_n_per_m,
        Hyperfoam(**hyper) if hyper else Hyperfoam(),
        Prony(tuple(prony["shares"]), tuple(prony["times_s"])) if prony else Prony(),
        BoucWen(**loss) if loss else BoucWen(),
        Mullins(**soft) if soft else Mullins(),
    )


class Stage:
    """A carriage with an indenter over the foam; remembers every place that was pressed.

    A carriage may glide on while a scan is read (``scan_skew``) and turn round late (``stage_backlash``).
    """

    def __init__(self, truth: Truth, stiffness_n_per_m: float) -> None:
        self.foam = foam_of(truth, stiffness_n_per_m)
        glide, play = truth.parameters("scan_skew"), truth.parameters("stage_backlash")
        self._glide = glide["step_share"] if glide else 0.0
        self._play_m = play["play_m"] if play else 0.0
        self._spots: list[tuple[Array, FoamSpot, float]] = []
        self.place_m: Array | None = None
        self.command_m = self._carriage_m = self._step_m = 0.0
        self._now_s = 0.0
        self._spot: FoamSpot | None = None

    @property
    def stiffened(self) -> float:
        """How many times stiffer than at first the foam under the indenter is, as a secant."""
        if self._spot is None or self._spot.sinking_m <= 0.0:
            return 1.0
        return self.foam.hyperfoam.sinking_equivalent_m(self._spot.sinking_m) / self._spot.sinking_m

    def move(self, time_s: float, place_m: Array | None, depth_m: float) -> float:
        """Force in newton at ``time_s``, the carriage told to be ``depth_m`` deep at ``place_m`` (2,) by then.

        No place, or no depth, is the air.
        """
        seconds = max(time_s - self._now_s, 0.0)
        self._now_s = time_s
        if place_m is None or not depth_m > 0.0:
            self._leave(seconds)
            return 0.0
        if self.place_m is None or np.hypot(*(self.place_m - place_m)) >= SAME_PLACE_M:
            self._leave(0.0)
            self._land(place_m)
        if depth_m != self.command_m:
            self._step_m = depth_m - self.command_m
        self.command_m = depth_m
        return self._press(depth_m, seconds)

    def during_scan(self, time_s: float, instants_s: Array) -> Array:
        """(S,) forces at instants (S,) of a scan that starts at ``time_s`` and ends with the last of them.

        A gliding carriage passes the commanded depth in the middle, in an S-shaped sweep along its last step.
        """
        forces = np.empty(len(instants_s))
        for number, instant in enumerate(instants_s):
            seconds = max(time_s + instant - self._now_s, 0.0)
            self._now_s = max(time_s + instant, self._now_s)
            beyond = 0.5 * self._glide * self._step_m * np.sin(np.pi * (instant / instants_s[-1] - 0.5))
            forces[number] = 0.0 if self._spot is None else self._press(self.command_m + beyond, seconds)
        self.stand()
        return forces

    def foreseen(self, time_s: float, instants_s: Array) -> Array:
        """(S,) forces at the instants of a scan to come, without living through it."""
        ahead = copy(self)
        ahead._spot = deepcopy(self._spot)
        return ahead.during_scan(time_s, instants_s)

    def stand(self) -> None:
        """The last step is over: a scan from now on sees no glide."""
        self._step_m = 0.0

    def _press(self, depth_m: float, seconds: float) -> float:
        if self._spot is None:
            raise RuntimeError("the indenter is in the air")
        self._carriage_m = max(depth_m, min(self._carriage_m, depth_m + self._play_m))
        return self._spot.press(self._carriage_m, seconds)

    def _leave(self, seconds: float) -> None:
        if self._spot is not None and self.place_m is not None:
            self._spot.press(0.0, seconds)
            self._spots.append((self.place_m, self._spot, self._now_s))
        self.place_m, self._spot = None, None
        self.command_m = self._carriage_m = self._step_m = 0.0

    def _land(self, place_m: Array) -> None:
        self.place_m, self._spot = np.array(place_m, dtype=float), FoamSpot(self.foam)
        for number, (where, spot, left_s) in enumerate(self._spots):
            if np.hypot(*(where - place_m)) < SAME_PLACE_M:
                spot.press(0.0, self._now_s - left_s)
                self._spot = spot
                del self._spots[number]
                return


def interpolation(nodes: Array, points: Array) -> Array:
    """(len(points), len(nodes)) weights of the polynomial through distinct nodes."""
    weights = np.ones((len(points), len(nodes)))
    for number, node in enumerate(nodes):
        for other in np.delete(nodes, number):
            weights[:, number] *= (points - other) / (node - other)
    return weights
