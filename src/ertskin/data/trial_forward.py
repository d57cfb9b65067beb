"""Trials on a grid, put together from single presses: the whole skin with its effects, many times faster."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ertskin.data.forward import PressForward
from ertskin.physics.conduction.pressed_sheet import in_chunks
from ertskin.physics.conduction.sheet import Resolution, Solution
from ertskin.physics.conduction.trials import APART_M, FAR, Level, TrialSolver

Array = NDArray[np.float64]

MANY = 20
"""Trials for each pair of places from which on a table, which solves nine, is worth its while."""


class PressedSkin:
    """A ``PressForward`` as ``TrialSolver`` asks it."""

    def __init__(self, forward: PressForward) -> None:
        self.forward = forward

    @property
    def rest(self) -> Solution:
        """The untouched sheet."""
        return self.forward.rest

    def pair_resistances(self, contact_m: Array, force_n: Array, workers: int = 1) -> Array:
        """(N,pairs) ohm under contacts (N,C,2) with forces (N,C), NaN for an absent one."""

        def some(rows: slice) -> Array:
            return self.forward.change_ohm(contact_m[rows], force_n[rows])

        return self.rest.pair_resistance_ohm + np.concatenate(in_chunks(some, len(contact_m), workers))


class TrialForward:
    """Presses at ``places_m`` (C,2) with forces up to ``max_force_n``, each after a rest; other presses are solved.

    What a contact does alone is solved at ``resolution`` for some forces and interpolated; what contacts do together
    comes from coarser meshes (``physics/conduction/trials.py``). ``build`` makes the skin at a resolution. ``trials``:
    how many will be asked; if these are many, pairs far from one another are tabulated first. ``workers``: threads
    that solve, with the same result for any number.
    """

    def __init__(
        self,
        build: Callable[[str | Resolution], PressForward],
        resolution: str | Resolution,
        places_m: Array,
        max_force_n: float,
        trials: int = 0,
        near: str | Resolution = "fast",
        workers: int = 1,
    ) -> None:
        self.direct = build(resolution)
        fine = PressedSkin(self.direct)
        coarse = fine if resolution == near else PressedSkin(build(near))
        pairs = len(places_m) * (len(places_m) - 1) // 2
        levels = [Level(0.0, coarse), Level(APART_M, PressedSkin(build(FAR)), trials > MANY * pairs)]
        self.solver = TrialSolver(fine, levels, places_m, max_force_n, workers=workers)

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        rest = self.direct.rest.pair_resistance_ohm
        covered = self.solver.covers(contact_m, force_n)
        change = np.empty((len(contact_m), len(rest)))
        change[covered] = self.solver.pair_resistances(contact_m[covered], force_n[covered]) - rest
        if not covered.all():
            change[~covered] = self.direct.change_ohm(contact_m[~covered], force_n[~covered])
        return change
