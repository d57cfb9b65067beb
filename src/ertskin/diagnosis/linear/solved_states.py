"""The states a recording visits, solved in full with their derivatives: about them its skin is linearised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, sparray

from ertskin.cores import in_threads
from ertskin.diagnosis.linear.pad_shunts import by_series, conducting, pad_resistances, uneven
from ertskin.diagnosis.linear.patches import Indices, Past, Patch, Solutions, State, followers, main_directions
from ertskin.diagnosis.linear.pressed_frames import PressedFrames
from ertskin.diagnosis.linear.sensitivity import (
    Hats,
    PadRims,
    Potentials,
    sheet_sensitivity,
    whitening_of_transfer,
)
from ertskin.diagnosis.linear.sheet_state import SheetState
from ertskin.physics.conduction.sheet import Solution
from ertskin.physics.contacts import contact_groups, frames_since, in_air, memory_frames, within

Array = NDArray[np.float64]

GRID_M = 1.5e-3
NEAR_CONTACTS = 0.03
"""Relative change of contact resistances that derivatives at rest still carry: what lies in series and what pads shunt
follow the resistance (``pad_shunts``), what both make of a press beside them doesn't."""
RANK = 128
"""Directions kept of the derivatives on a patch's grid. On the paper's skin 100 leave 5e-4 of the noise out of a change
of a tenth of the signal; every evaluation reads that much less memory."""

Progress = Callable[[float, str], None]
Contacts = tuple[Array, Array | None]
"""What ``PressedFrames.contacts`` gives."""


class UntouchedSheet:
    """The sheet that nothing presses, at the points (N,2) of its skin's mesh, as warm as it usually is."""

    def __init__(self, frames: PressedFrames) -> None:
        self.frames, self.skin = frames, frames.skin
        self.points_m = self.skin.sheet.quadrature_m.reshape(-1, 2)
        self.state = SheetState.of(self.skin, self.points_m)
        self._whitening = whitening_of_transfer(self.skin.protocol)

    @cached_property
    def scale_s(self) -> Array:
        """(N,) size in siemens of its conductance."""
        sheet = self.skin.sheet
        warmth = np.repeat(self.frames.usual_warmth(sheet.quadrature_m.mean(axis=1)), sheet.weight_m2.shape[1])
        return np.asarray(np.exp(self.state.log_size + warmth) / self.skin.piezo.zero_ohm_sq)

    def by_size(
        self, solution: Solution | Potentials, elements: Indices, hats: sparray, points: Indices
    ) -> NDArray[np.float32]:
        """(P,G) derivatives of a solution's scan by the relative size of the conductance, hats (G,n) at points (n,)."""
        tensor, scale = self.state.tensor, self.scale_s[points]
        if self.state.even_tensor:
            return sheet_sensitivity(solution, elements, hats, self._whitening, tensor[:1], scale)[0]
        parts = [
            sheet_sensitivity(solution, elements, hats, self._whitening, unit[None], scale * part)[0]
            for unit, part in zip(np.eye(3), tensor[points].T, strict=True)
        ]
        return np.sum(parts, axis=0, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Place:
    """Where a patch lies on the mesh: the ``elements`` (E,) within reach and their ``points`` (n,), those ``close`` by
    (c,) that presses change, the fronts ``asked`` for, the grid's ``hats`` (G,n) and electrodes ``leaning`` (q,)."""

    elements: Indices
    points: Indices
    close: Indices
    asked: NDArray[np.bool_]
    hats: csc_array
    leaning: Indices


class StateSolver:
    """Solves the states of a recording's frames on their skin's mesh, that at ``rest`` first.

    ``by_series`` (P,L) and ``pad_ohm`` (L,): what contacts make of scans, as ``pad_shunts`` has it.
    """

    def __init__(self, sheet: UntouchedSheet) -> None:
        self.sheet, self.frames, self.skin = sheet, sheet.frames, sheet.skin
        self.protocol = self.skin.protocol
        self._rims, self.by_series = PadRims(self.skin.sheet), by_series(self.protocol)
        self.pad_ohm = pad_resistances(self.skin.sheet, self.skin.piezo.zero_ohm_sq)
        self.rest = self._solve(np.ones(len(sheet.points_m)), self.skin.contact_resistance_ohm)

    def patches(self, forces: Sequence[Array], progress: Progress) -> list[list[Patch]]:
        """The patches of the frames under each of several ``forces`` (T,C), which share the states solved."""
        frames = self.frames
        groups = contact_groups(np.round(frames.contact_m[frames.wanted], 9), frames.force_n[frames.wanted])
        contacts = [frames.contacts(self.skin, force_n, frames.drift(self.skin)) for force_n in forces]
        # What they remember is begun before several threads ask for it.
        for force_n in forces:
            frames.memory(force_n)
        done = 0

        def one(rows: Indices) -> list[Patch]:
            nonlocal done
            found = self._at_place(rows, forces, contacts)
            done += 1
            progress(done / len(groups), f"linearised {done} of {len(groups)} places")
            return found

        return [list(alike) for alike in zip(*in_threads(one, groups), strict=True)]

    def _solve(
        self, relative: Array, contact_ohm: Array, base: Solution | None = None, share: Array | None = None
    ) -> Solution:
        """Solution for a relative conductance (E*Q,) of the sheet, the skin's own tensor and field included."""
        conductance = (relative * self.sheet.scale_s).reshape(self.skin.sheet.weight_m2.shape)
        if self.sheet.state.isotropic and base is not None and np.array_equal(base.contact_resistance_ohm, contact_ohm):
            if np.array_equal(conductance, base.conductivity_s):
                return base
            return self.skin.sheet.solve_again(conductance, base)
        return self.skin.sheet.solve(self.sheet.state.shaped(conductance), contact_ohm, share)

    def _at_place(self, rows: Indices, forces: Sequence[Array], contacts: Sequence[Contacts]) -> list[Patch]:
        """The patch of rows that share their contacts, under each of the forces, with the ``contacts`` of all rows."""
        frames, skin, count = self.frames, self.skin, len(rows)
        patch, place = self._around(rows)
        relative = np.concatenate([frames.relative(skin, force_n, patch) for force_n in forces])
        ohm = np.concatenate([each[rows] for each, _ in contacts])
        state_of, leaders = followers(relative, ohm, skin.contact_resistance_ohm)
        before, states = patch.past_of(skin), []
        for number, (force_n, (every_ohm, every_share)) in enumerate(zip(forces, contacts, strict=True)):
            mine = [k - number * count for k in leaders if k // count == number]
            if not mine:
                continue
            led = Past(before.frames, before.own[mine])
            pressed = frames.relative_at(skin, force_n, self.sheet.points_m[place.close], led)
            for k, values in zip(mine, pressed, strict=True):
                share = None if every_share is None else every_share[rows[k]]
                solution = self._pressed(place.close, values, every_ohm[rows[k]], share)
                states.append(self._state(solution.confined(place.asked), relative[number * count + k], place))
        directions = main_directions(np.concatenate([state.local for state in states]), RANK)
        states = [replace(state, local=state.local @ directions) for state in states]
        shared = Solutions(states, directions)
        return [replace(patch, solutions=shared, state_of=mine) for mine in np.split(state_of, len(forces))]

    def _around(self, rows: Indices) -> tuple[Patch, Place]:
        """The patch of rows that share their contacts before anything is solved for it, and where it lies."""
        spots, reach_m, points_m = self.frames.spots_m(rows), self.frames.reach_m, self.sheet.points_m
        low_m, high_m = self.skin.sensor.extent_m
        low, high = low_m, low_m + GRID_M
        if len(spots):
            low = np.maximum(spots.min(axis=0) - reach_m, low_m)
            high = np.minimum(spots.max(axis=0) + reach_m, high_m)
        hats = Hats(low, high, GRID_M)
        inside = np.flatnonzero(within(hats.node_m, spots, reach_m + 2 * GRID_M))
        visited, air = self.frames.wanted[rows], in_air(self.frames.contact_m, self.frames.force_n)
        visits = memory_frames(self.frames.contact_m, self.frames.force_n, spots, reach_m)
        past, since_air = (
            Past(known, np.searchsorted(known, visited)) for known in (visits, frames_since(air, visited))
        )
        touched = [within(contact.center_m, spots, reach_m).any() for contact in self.skin.sheet.contacts]
        leaning, nothing = np.flatnonzero(touched), Solutions([], np.zeros((len(inside), 0), dtype=np.float32))
        per = self.skin.sheet.weight_m2.shape[1]
        elements = np.flatnonzero(within(points_m, spots, reach_m).reshape(-1, per).any(axis=1))
        points = (elements[:, None] * per + np.arange(per)).ravel()
        close = points[within(points_m[points], spots, reach_m)]
        at_points = hats.values(points_m[points])[inside].tocsc()
        place = Place(elements, points, close, self.skin.sheet.asked_at(elements), at_points, leaning)
        return Patch(rows, past, since_air, hats, inside, leaning, nothing, np.zeros(len(rows), dtype=np.intp)), place

    def _pressed(self, close: Indices, relative: Array, ohm: Array, share: Array | None) -> Solution:
        """The solution for ``relative`` conductances (n,) at the points ``close`` and contacts (L,), those at rest
        unless they differ much, whose cells (C,) have their ``share``."""
        sheet = np.ones(len(self.sheet.points_m))
        sheet[close] = relative
        usual_ohm = self.skin.contact_resistance_ohm
        if np.abs(ohm / usual_ohm - 1).max() < NEAR_CONTACTS:
            return self._solve(sheet, usual_ohm, self.rest)
        return self._solve(sheet, ohm, share=share)

    def _state(self, solution: Solution, relative: Array, place: Place) -> State:
        """A solution's scan and derivatives at a place, ``relative`` (G,) the conductance on its grid."""
        contacts, by_contact = self._by_contact(solution, place.leaning)
        return State(
            self.protocol.whitened(solution.pair_resistance_ohm) - self.by_series @ solution.contact_resistance_ohm,
            relative,
            contacts,
            self.sheet.by_size(solution, place.elements, place.hats, place.points),
            by_contact,
            self._rims.sensitivity(solution, self.protocol),
        )

    def _by_contact(self, solution: Solution, leaning: Indices) -> tuple[Array, Array]:
        """A solution's contacts (K,) as ``Patch.contacts`` has them, and the derivatives (P,K) of its scan by them."""
        model, ohm, share = self.skin.sheet, solution.contact_resistance_ohm, solution.share
        conduct = conducting(ohm, self.pad_ohm)
        by_ohm = self.protocol.whitened(solution.jacobian_contact_resistance().T).T - self.by_series
        if not len(leaning):
            return conduct, -by_ohm / conduct**2
        lean = np.zeros((len(leaning), model.contacts[0].form_count))
        if share is not None:
            lean = np.array([model.contacts[k].lean(share[model.cells[k]]) for k in leaning])
        by = uneven(ohm, self.pad_ohm)[leaning, None]
        by_pair = solution.jacobian_contact_lean(leaning) / by
        by_lean = np.moveaxis(self.protocol.whitened(np.moveaxis(by_pair, 0, -1)), -1, 0)
        by_ohm[:, leaning] -= (by_lean * lean).sum(axis=-1) * (self.pad_ohm * conduct)[leaning] ** 2
        contacts = np.append(conduct, by * lean)
        return contacts, np.hstack([-by_ohm / conduct**2, by_lean.reshape(len(by_ohm), -1)])
