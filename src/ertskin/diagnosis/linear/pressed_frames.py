"""What a recording's frames press, for any skin of a family: forces, pressures, contacts, the fabric's conductance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.linear.patches import Indices, Past, Patch
from ertskin.physics.contacts import in_contact
from ertskin.physics.effects.effect import Effect, ElectrodeEffect, FoamEffect, MotionEffect, PlacementEffect
from ertskin.physics.effects.piezo_chain import in_fabric
from ertskin.physics.history import History
from ertskin.physics.skin import TAIL, Skin

Array = NDArray[np.float64]

REMEMBERED = 2000
"""Pressures are remembered for grids of fewer points than this."""
MOTIONS = 3
"""How many motions' forces are remembered: that of a fit, and a step in each of a motion's two numbers."""


def motions(effects: Sequence[Effect]) -> list[MotionEffect]:
    """The effects by which contacts move during a scan."""
    return [e for e in effects if isinstance(e, MotionEffect) and e.moves]


def of_fabric(skin: Skin) -> tuple[object, ...]:
    """What, under given pressures, a fabric's resistance over that at rest depends on."""
    return skin.piezo.coefficients.tobytes(), skin.piezo.max_stress_pa, tuple(in_fabric(skin.effects))


@dataclass(eq=False)
class Memory:
    """What was computed last under the forces ``force_n`` (T,C): most parameters that a fit moves leave most of it as
    it is.

    ``pressures`` by points and frames, ``relative`` and ``change`` by patch; ``regime``: pressure field and mechanics
    that they belong to. ``still``: a skin and its scans (n,P). Forces of a moment go with the patches of that moment.
    """

    force_n: Array
    regime: tuple[object, tuple[Effect, ...]] = (None, ())
    pressures: dict[tuple[bytes, bytes], Array] = field(default_factory=dict)
    relative: dict[int, tuple[object, Array]] = field(default_factory=dict)
    change: dict[int, tuple[object, NDArray[np.float32]]] = field(default_factory=dict)
    still: tuple[Skin, Array] | None = None

    def settle(self, skin: Skin) -> None:
        """Forget the pressures of another pressure field or other mechanics."""
        placement = tuple(e for e in skin.effects if isinstance(e, PlacementEffect | FoamEffect))
        if not (self.regime[0] is skin.pressure and self.regime[1] == placement):
            self.pressures, self.relative, self.change = {}, {}, {}
            self.regime = skin.pressure, placement


class PressedFrames:
    """The ``wanted`` frames (n,) of a history under forces (T,C), the others as their past, about a ``skin``."""

    def __init__(self, skin: Skin, history: History, force_n: Array, wanted: Indices) -> None:
        self.skin, self.history, self.force_n, self.wanted = skin, history, force_n, wanted
        self.contact_m = skin.contact_m(history.contact_m)
        self.present = in_contact(self.contact_m, force_n)
        self.reach_m = skin.pressure.radius_m(TAIL)
        self.memories = [Memory(force_n)]
        self._moved: list[tuple[tuple[object, ...], Array, list[Array]]] = []

    def spots_m(self, rows: Indices) -> Array:
        """(S,2) what is pressed where rows of the wanted frames share their contacts."""
        first = self.wanted[rows[0]]
        return self.contact_m[first][self.present[first]]

    # forces and pressures --------------------------------------------------------------------------------------------

    def moved_forces(self, skin: Skin, skew: MotionEffect, force_n: Array, moments: Array) -> list[Array]:
        """Forces (T,C) at each of the moments; the latest are remembered, for pressures are by them."""
        foam = tuple(e for e in skin.effects if isinstance(e, FoamEffect))
        key = (skew, foam, skin.pad_n_per_m, skin.support_n_per_m, moments.tobytes())
        known = next((one for one in self._moved if one[0] == key and one[1] is force_n), None)
        if known is None:
            known = key, force_n, [force_n * share for share in skin.moving_share(self.history, skew, moments)]
            self._moved = [*self._moved[1 - MOTIONS :], known]
        return known[2]

    def memory(self, force_n: Array) -> Memory:
        """The memory of what some forces do; those of the latest motions are kept, at each of their moments."""
        known = next((one for one in self.memories if one.force_n is force_n), None)
        if known is None:
            known = Memory(force_n)
            kept = MOTIONS * max((len(forces) for _, _, forces in self._moved), default=1)
            self.memories = [*self.memories[max(0, len(self.memories) + 1 - kept) :], known]
        return known

    def pressure(self, skin: Skin, force_n: Array, position_m: Array, frames: Indices) -> Array:
        """Pressures (n,N), remembered for the latest pressure field, mechanics and forces."""
        memory = self.memory(force_n)
        memory.settle(skin)
        key = (position_m.tobytes(), frames.tobytes())
        found = memory.pressures.get(key)
        if found is None:
            contact = skin.contact_m(self.history.contact_m[frames])
            found = skin.pressure_pa(position_m, contact, force_n[frames])
            if len(position_m) < REMEMBERED:
                memory.pressures[key] = found
        return found

    # the fabric's conductance ----------------------------------------------------------------------------------------

    def relative_at(self, skin: Skin, force_n: Array, position_m: Array, past: Past) -> Array:
        """(m,N) conductance at positions (N,2) over that at rest, for the past's own frames."""
        pressure = self.pressure(skin, force_n, position_m, past.frames)
        fabric = skin.fabric_ohm_sq(pressure, position_m, self.history.time_s[past.frames], past.own)
        return np.asarray(skin.piezo.zero_ohm_sq / fabric)

    def relative(self, skin: Skin, force_n: Array, patch: Patch) -> Array:
        """(m,G) the same on a patch's grid, for its rows."""
        if not len(patch.inside):
            return np.zeros((len(patch.rows), 0))
        return self.relative_at(skin, force_n, patch.grid_m, patch.past_of(skin))

    def relative_of(self, number: int, patch: Patch, skin: Skin, force_n: Array) -> Array:
        """``relative`` of the patch of this ``number``, remembered for the latest law and memories under the pressures
        at hand."""
        key, latest = of_fabric(skin), self.memory(force_n).relative
        if number not in latest or latest[number][0] != key:
            latest[number] = key, self.relative(skin, force_n, patch)
        return latest[number][1]

    # contacts, time --------------------------------------------------------------------------------------------------

    def contacts(self, skin: Skin, force_n: Array, factor: Array | float = 1.0) -> tuple[Array, Array | None]:
        """(n,L) contact resistances in ohm of the wanted frames over a ``factor`` (n,), and what their cells conduct
        over the mean (n,C), those of the linearised skin's mesh; None where neither skin's follow their pressure."""
        wanted, contact_m = self.wanted, skin.contact_m(self.history.contact_m)
        # Another skin of the family may lie on the mesh of pads that nothing has moved.
        meshed = replace(skin, sheet=self.skin.sheet)
        ohm, share = meshed.contacts(self.history.time_s[wanted], contact_m[wanted], force_n[wanted])
        if share is None and self._uneven:
            share = np.broadcast_to(1.0, (len(ohm), meshed.sheet.cells[-1].stop))
        return ohm / np.reshape(factor, (-1, 1)), share

    @cached_property
    def _uneven(self) -> bool:
        """Whether contacts of the linearised skin follow their pressure."""
        return any(isinstance(effect, ElectrodeEffect) and effect.by_pressure for effect in self.skin.effects)

    def drift(self, skin: Skin) -> Array:
        """(n,) factor of the wanted frames' resistances."""
        return skin.drift(self.history.time_s)[self.wanted]

    def usual_warmth(self, position_m: Array) -> Array:
        """(N,) mean logarithm over the wanted frames of what warmth makes of the conductance at positions (N,2)."""
        warmth = self.skin.warmth(position_m, self.history.time_s, self.wanted)
        return np.zeros(len(position_m)) if warmth is None else warmth.mean(axis=0)
