"""What changes a sheet where a frame's own contacts don't reach: places not recovered yet, warmth that comes and goes.

To first order about rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.linear.law_derivatives import conductance_by_law
from ertskin.diagnosis.linear.patches import Patch
from ertskin.diagnosis.linear.sensitivity import Hats, Potentials
from ertskin.diagnosis.linear.solved_states import UntouchedSheet
from ertskin.diagnosis.linear.whole_sheet import WholeSheet, on_sheet
from ertskin.physics.contacts import within
from ertskin.physics.effects.piezo_chain import felt, response_power
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

GRID_M = 4e-3
"""Grid for what is away from presses: a press's own changes are resolved finer."""


class Elsewhere:
    """Scans' changes by what the sheet does away from a frame's own contacts, about what it is at ``rest``."""

    def __init__(
        self, untouched: UntouchedSheet, rest: Potentials, patches: Sequence[Patch], sheet: WholeSheet
    ) -> None:
        self.untouched, self.rest, self.patches, self.sheet = untouched, rest, patches, sheet
        self.frames = untouched.frames
        self._latest: tuple[object, Array | None] = (None, None)

    def change(self, skin: Skin, force_n: Array) -> list[Array]:
        """(n,P) changes of the scans, none or more to be added."""
        found = self._left_behind(skin, force_n), self._warmed(skin)
        return [part for part in found if part is not None]

    def by_law(self, skin: Skin, force_n: Array, count: int) -> Array | None:
        """(n,P,count) derivatives of what presses have left by the law's coefficients; None if nothing remembers."""
        if not skin.remembers_air:
            return None
        (nodes, columns, own), frames = self._everywhere, self.frames
        pressure = frames.pressure(skin, force_n, nodes, np.arange(len(force_n)))
        answers = felt(skin.effects, pressure, nodes, frames.history.time_s, skin.sensor.extent_m, frames.wanted)
        weight = np.where(own, 0.0, np.exp(-self.sheet.beyond(skin, nodes).log_size))
        power = response_power(skin.effects, nodes, skin.sensor.extent_m)
        change = conductance_by_law(skin.piezo, *answers, weight, count, power)
        return np.asarray((change @ columns.T).transpose(0, 2, 1))

    @cached_property
    def _everywhere(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Nodes (H,2) over the whole sheet, derivatives (P,H) at rest by their relative conductance, and which nodes
        each of the wanted frames has within reach of its own contacts (n,H): there the patches tell."""
        untouched, frames = self.untouched, self.frames
        low, high = untouched.skin.sensor.extent_m
        hats = Hats(low, high, GRID_M)
        elements, points = np.arange(len(untouched.skin.sheet.weight_m2)), np.arange(len(untouched.points_m))
        columns = untouched.by_size(self.rest, elements, hats.values(untouched.points_m), points)
        own = np.zeros((len(frames.wanted), len(hats.node_m)), dtype=bool)
        for patch in self.patches:
            own[patch.rows] = within(hats.node_m, frames.spots_m(patch.rows), frames.reach_m)
        return hats.node_m, columns.astype(float), own

    def _left_behind(self, skin: Skin, force_n: Array) -> Array | None:
        """(n,P) change of the scans by what presses elsewhere have left; None if nothing remembers."""
        if not skin.remembers_air:
            return None
        (nodes, columns, own), frames = self._everywhere, self.frames
        pressure = frames.pressure(skin, force_n, nodes, np.arange(len(force_n)))
        change = skin.left_behind(frames.history.time_s, nodes, pressure, frames.wanted)
        # The current that flows anyway dissipates with the resistance.
        change = change * np.exp(-self.sheet.beyond(skin, nodes).log_size)
        return np.where(own, 0.0, change) @ columns.T

    def _warmed(self, skin: Skin) -> Array | None:
        """``_warmed_by`` the effects on the sheet, remembered for the latest."""
        key = on_sheet(skin)
        if self._latest[0] != key:
            self._latest = key, self._warmed_by(skin)
        return self._latest[1]

    def _warmed_by(self, skin: Skin) -> Array | None:
        """(n,P) change of the scans by what comes and goes in the sheet, about what is usual there; None for none."""
        frames = self.frames
        somewhere = self.untouched.points_m[:1], frames.history.time_s[:1], np.zeros(1, dtype=np.intp)
        if all(one.warmth(*somewhere) is None for one in (skin, self.untouched.skin)):
            return None
        nodes, columns, _ = self._everywhere
        warmth = skin.warmth(nodes, frames.history.time_s, frames.wanted)
        change = np.expm1((0.0 if warmth is None else warmth) - self._usual_warmth)
        change = np.broadcast_to(change, (len(frames.wanted), len(nodes)))
        return np.asarray(change * np.exp(-self.sheet.beyond(skin, nodes).log_size) @ columns.T)

    @cached_property
    def _usual_warmth(self) -> Array:
        return self.frames.usual_warmth(self._everywhere[0])
