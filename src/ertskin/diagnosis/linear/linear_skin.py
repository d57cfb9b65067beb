"""A skin linearised about the states its recording visits: scans for other parameters without solving again.

What a parameter does to the sheet's conductance near the contacts is computed exactly, on a small grid around them;
only conduction is linear, about a solution of the nearest state, and for what presses have left behind elsewhere, about
rest. Everything is in whitened coordinates (volt).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, sparray

from ertskin.cores import in_threads, in_threads_by_turns
from ertskin.diagnosis.linear.law_derivatives import conductance_by_law
from ertskin.diagnosis.linear.memory import Memory
from ertskin.diagnosis.linear.patches import (
    Past,
    Patch,
    State,
    contact_groups,
    followers,
    in_contact,
    main_directions,
    main_forms,
    memory_frames,
    within,
)
from ertskin.diagnosis.linear.sensitivity import Hats, PadRims, model_elements, sheet_sensitivity, whitening_of_transfer
from ertskin.diagnosis.linear.sheet_state import SheetState, displaced, pad_shifts
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel, Solution
from ertskin.physics.effects.effect import (
    Effect,
    ElectrodeEffect,
    FoamEffect,
    MotionEffect,
    SheetEffect,
    Stage,
)
from ertskin.physics.effects.piezo_chain import felt, in_fabric
from ertskin.physics.history import History
from ertskin.physics.skin import TAIL, Skin, frames_since, moments_of

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

GRID_M = 1.5e-3
NEAR_CONTACTS = 0.03
"""Relative change of contact resistances that their first derivatives still carry: a series resistance is linear."""
SHEET_GRID_M = 5e-3
SHEET_SAMPLE_M = 1.5e-3
"""Spacing of the points at which a field of the sheet is read, to be spread over the grid ``SHEET_GRID_M``."""
LEFT_GRID_M = 4e-3
"""Grid for what presses have left behind: a press's own changes are resolved finer."""
REMEMBERED = 2000
"""Pressures are remembered for grids of fewer points than this."""
MOTIONS = 3
"""How many motions' forces are remembered: that of a fit, and a step in each of a motion's two numbers."""
RANK = 128
"""Directions kept of the derivatives on a patch's grid. On the paper's skin 100 leave 5e-4 of the noise out of a change
of a tenth of the signal; every evaluation reads that much less memory."""
COARSE = Resolution(2, Grading(cell_m=5e-3, rim_m=5e-4, growth=7.0, spread=0.7))
"""Mesh for derivatives by what changes the whole sheet: good to a percent of them."""
SHEET_TENSORS = np.array([[1.0, 0.0, 1.0], [0.5, 0.0, -0.5], [0.0, 0.5, 0.0]])
"""Scalar change of conductance and the two derivatives of the anisotropic tensor at isotropy."""

Progress = Callable[[float, str], None]
Fields = Callable[[Array], Array]
"""Values (N,K) of K fields at positions (N,2)."""


def motions(effects: Sequence[Effect]) -> list[MotionEffect]:
    """The effects by which contacts move during a scan."""
    return [e for e in effects if isinstance(e, MotionEffect) and e.moves]


def _stacked(change: SheetState) -> Array:
    """(3,N) relative change of the conductance, and of the anisotropy along x and along the diagonal."""
    return np.vstack([np.expm1(change.log_size), change.stretch.T])


def _on_sheet(skin: Skin) -> tuple[Effect, ...]:
    """The effects on the sheet as a whole: what most parameters leave alone."""
    return tuple(e for e in skin.effects if isinstance(e, SheetEffect))


def _of_fabric(skin: Skin) -> tuple[object, ...]:
    """What, under given pressures, a fabric's resistance over that at rest depends on."""
    return skin.piezo.coefficients.tobytes(), skin.piezo.max_stress_pa, tuple(in_fabric(skin.effects))


def _same_network(one: Skin, other: Skin | None) -> bool:
    """Whether two skins of one family differ by what acts on their readings alone."""
    if one is other:
        return True
    return (
        other is not None
        and one.pressure is other.pressure
        and one.piezo.zero_ohm_sq == other.piezo.zero_ohm_sq
        and _of_network(one) == _of_network(other)
        and _of_fabric(one) == _of_fabric(other)
        and np.array_equal(one.contact_resistance_ohm, other.contact_resistance_ohm)
    )


def _of_network(skin: Skin) -> tuple[Effect, ...]:
    """The effects on what is read."""
    return tuple(e for e in skin.effects if e.stage != Stage.ACQUISITION or isinstance(e, MotionEffect))


class LinearSkin:
    """Whitened scans of a history for any calibration and effects near those of ``skin``.

    Of the ``wanted`` frames (n,), in recording order; the history's others count as their past.
    """

    def __init__(
        self,
        skin: Skin,
        history: History,
        force_n: Array,
        wanted: Indices | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.skin = skin
        self.history = history
        self.force_n = force_n
        self.wanted = np.arange(len(history)) if wanted is None else wanted
        self.protocol = skin.protocol
        self._whitening = whitening_of_transfer(skin.protocol)
        self._contact = skin.contact_m(history.contact_m)
        self._memories = [Memory(force_n)]
        self._latest_field: dict[int, tuple[object, Array]] = {}
        self._latest_broad: tuple[object, list[Array] | None] = (None, None)
        self._latest_warmed: tuple[object, Array | None] = (None, None)
        self._moving: tuple[Skin, Array, list[Array]] | None = None
        self._mixing: dict[bool, tuple[Array, list[Array]]] = {}
        self._moved: list[tuple[tuple[object, ...], Array, list[Array]]] = []
        self._rims = PadRims(skin.sheet)
        self._points = skin.sheet.quadrature_m.reshape(-1, 2)
        self._sheet = SheetState.of(skin, self._points)
        self._rest = self._solve(self._rest_relative, skin.contact_resistance_ohm)
        self._contacts_now = self._contacts(skin, force_n, self._drift(skin))
        self.patches = self._build(progress or (lambda share, text: None))
        self._moments = self._at_moments(progress)

    # building ------------------------------------------------------------------------------------------------------

    @cached_property
    def _rest_relative(self) -> Array:
        return np.ones(len(self._points))

    def _solve(
        self, relative: Array, contact_ohm: Array, base: Solution | None = None, share: Array | None = None
    ) -> Solution:
        """Solution for a relative conductance (E*Q,) of the sheet, the skin's own tensor and field included."""
        conductance = (relative * self._scale_s).reshape(self.skin.sheet.weight_m2.shape)
        if self._sheet.isotropic and base is not None and np.array_equal(base.contact_resistance_ohm, contact_ohm):
            if np.array_equal(conductance, base.conductivity_s):
                return base
            return self.skin.sheet.solve_again(conductance, base)
        return self.skin.sheet.solve(self._sheet.shaped(conductance), contact_ohm, share)

    @cached_property
    def _scale_s(self) -> Array:
        """(E*Q,) size in siemens of the untouched sheet's conductance, as warm as it usually is."""
        warmth = np.repeat(
            self._usual_warmth(self.skin.sheet.quadrature_m.mean(axis=1)), self.skin.sheet.weight_m2.shape[1]
        )
        return np.asarray(np.exp(self._sheet.log_size + warmth) / self.skin.piezo.zero_ohm_sq)

    def _by_size(self, solution: Solution, elements: Indices, hats: sparray, points: Indices) -> NDArray[np.float32]:
        """(P,G) derivatives of a solution's scan by the relative size of the conductance, hats (G,n) at points (n,)."""
        tensor, scale = self._sheet.tensor, self._scale_s[points]
        if self._sheet.even_tensor:
            return sheet_sensitivity(solution, elements, hats, self._whitening, tensor[:1], scale)[0]
        parts = [
            sheet_sensitivity(solution, elements, hats, self._whitening, unit[None], scale * part)[0]
            for unit, part in zip(np.eye(3), tensor[points].T, strict=True)
        ]
        return np.sum(parts, axis=0, dtype=np.float32)

    def _build(self, progress: Progress) -> list[Patch]:
        groups = contact_groups(self._contact[self.wanted], self.force_n[self.wanted])
        done = 0

        def one(rows: Indices) -> Patch:
            nonlocal done
            patch = self._patch(rows)
            done += 1
            progress(done / len(groups), f"linearised {done} of {len(groups)} places")
            return patch

        return in_threads(one, groups)

    def _patch(self, rows: Indices) -> Patch:
        first = self.wanted[rows[0]]
        spots = self._contact[first][in_contact(self._contact, self.force_n)[first]]
        reach = self.skin.pressure.radius_m(TAIL)
        patch = self._around(spots, rows, reach)
        elements = model_elements(self.skin.sheet, within(self._points, spots, reach))
        relative = self._relative(self.skin, self.force_n, patch)
        state_of, leaders = followers(relative, self._contacts_now[0][rows], self.skin.contact_resistance_ohm)
        per = self.skin.sheet.weight_m2.shape[1]
        points = (elements[:, None] * per + np.arange(per)).ravel()
        close = points[within(self._points[points], spots, reach)]
        before = patch.past_of(self.skin)
        led = Past(before.frames, before.own[leaders])
        pressed = self._relative_at(self.skin, self.force_n, self._points[close], led)
        asked = self.skin.sheet.asked_at(elements)
        columns = patch.hats.values(self._points[points])[patch.inside].tocsc()
        solved = (
            (self._pressed(close, values, rows[k]).confined(asked), relative[k])
            for k, values in zip(leaders, pressed, strict=True)
        )
        states = [self._state(*each, elements, points, columns, patch.leaning) for each in solved]
        directions = main_directions(np.concatenate([state.local for state in states]), RANK)
        states = [replace(state, local=state.local @ directions) for state in states]
        return replace(patch, states=states, state_of=state_of, directions=directions)

    def _around(self, spots: Array, rows: Indices, reach_m: float) -> Patch:
        """The patch of rows that press the same spots (S,2), before anything is solved for it."""
        low_m, high_m = self.skin.sensor.extent_m
        low, high = low_m, low_m + GRID_M
        if len(spots):
            low = np.maximum(spots.min(axis=0) - reach_m, low_m)
            high = np.minimum(spots.max(axis=0) + reach_m, high_m)
        hats = Hats(low, high, GRID_M)
        inside = np.flatnonzero(within(hats.node_m, spots, reach_m + 2 * GRID_M))
        frames, in_air = self.wanted[rows], np.asarray(~in_contact(self._contact, self.force_n).any(axis=1))
        visits, since = memory_frames(self._contact, self.force_n, spots, reach_m), frames_since(in_air, frames)
        past, since_air = (Past(known, np.searchsorted(known, frames)) for known in (visits, since))
        nobody, unknown = np.zeros(len(rows), dtype=np.intp), np.zeros((len(inside), 0), dtype=np.float32)
        touched = [within(contact.center_m, spots, reach_m).any() for contact in self.skin.sheet.contacts]
        return Patch(rows, past, since_air, hats, inside, [], nobody, unknown, np.flatnonzero(touched))

    def _pressed(self, close: Indices, relative: Array, row: int) -> Solution:
        """The solution for ``relative`` conductances (n,) at the points ``close`` and the contacts of a row, those at
        rest unless they differ much."""
        sheet = self._rest_relative.copy()
        sheet[close] = relative
        usual_ohm, (ohm, share) = self.skin.contact_resistance_ohm, self._contacts_now
        if np.abs(ohm[row] / usual_ohm - 1).max() < NEAR_CONTACTS:
            return self._solve(sheet, usual_ohm, self._rest)
        return self._solve(sheet, ohm[row], share=None if share is None else share[row])

    def _state(
        self,
        solution: Solution,
        relative: Array,
        elements: Indices,
        points: Indices,
        hats: csc_array,
        leaning: Indices,
    ) -> State:
        """A solution's scan and derivatives, by the conductance in the elements, whose points are ``points``, on the
        patch's grid with its ``hats`` (G,n), ``relative`` (G,) the conductance there, and by contacts of which some
        may be ``leaning``."""
        contacts, by_contact = self._by_contact(solution, leaning)
        return State(
            self.protocol.whitened(solution.pair_resistance_ohm),
            relative,
            contacts,
            self._by_size(solution, elements, hats, points),
            self.protocol.whitened(by_contact.T).T,
            self._rims.sensitivity(solution, self.protocol),
        )

    def _by_contact(self, solution: Solution, leaning: Indices) -> tuple[Array, Array]:
        """A solution's contacts (K,) as ``Patch.contacts`` has them, and the derivatives (P,K) of its pairs by them."""
        model, ohm, share = self.skin.sheet, solution.contact_resistance_ohm, solution.share
        by_ohm = solution.jacobian_contact_resistance()
        if not len(leaning):
            return ohm, by_ohm
        lean = np.zeros((len(leaning), model.contacts[0].form_count))
        if share is not None:
            lean = np.array([model.contacts[k].lean(share[model.cells[k]]) for k in leaning])
        by_lean = solution.jacobian_contact_lean(leaning) / ohm[leaning, None]
        by_ohm[:, leaning] -= (by_lean * lean).sum(axis=-1)
        return np.append(ohm, ohm[leaning, None] * lean), np.hstack([by_ohm, by_lean.reshape(len(by_ohm), -1)])

    # places not recovered --------------------------------------------------------------------------------------------

    @cached_property
    def _everywhere(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Nodes (H,2) over the whole sheet, derivatives (P,H) at rest by their relative conductance, and which nodes
        each of the wanted frames has within reach of its own contacts (n,H): there the patches tell."""
        low, high = self.skin.sensor.extent_m
        hats = Hats(low, high, LEFT_GRID_M)
        elements = np.arange(len(self.skin.sheet.weight_m2))
        columns = self._by_size(self._rest, elements, hats.values(self._points), np.arange(len(self._points)))
        present = in_contact(self._contact, self.force_n)
        reach = self.skin.pressure.radius_m(TAIL)
        own = np.zeros((len(self.wanted), len(hats.node_m)), dtype=bool)
        for patch in self.patches:
            frame = self.wanted[patch.rows[0]]
            own[patch.rows] = within(hats.node_m, self._contact[frame][present[frame]], reach)
        return hats.node_m, columns.astype(float), own

    def _left_behind(self, skin: Skin, force_n: Array) -> Array | None:
        """(n,P) change of the scans by what presses elsewhere have left, to first order; None if nothing remembers."""
        if not skin.remembers_air:
            return None
        nodes, columns, own = self._everywhere
        pressure = self._pressure(skin, force_n, nodes, np.arange(len(force_n)))
        change = skin.left_behind(self.history.time_s, nodes, pressure, self.wanted)
        # The current that flows anyway dissipates with the resistance.
        change = change * np.exp(-self._sheet_change(skin, nodes).log_size)
        return np.where(own, 0.0, change) @ columns.T

    def _warmed(self, skin: Skin) -> Array | None:
        """``_warmed_by`` the effects on the sheet, remembered for the latest."""
        key = _on_sheet(skin)
        if self._latest_warmed[0] != key:
            self._latest_warmed = key, self._warmed_by(skin)
        return self._latest_warmed[1]

    def _warmed_by(self, skin: Skin) -> Array | None:
        """(n,P) change of the scans by what comes and goes in the sheet, to first order about what is usual there; None
        for none."""
        somewhere = self._points[:1], self.history.time_s[:1], np.zeros(1, dtype=np.intp)
        if all(one.warmth(*somewhere) is None for one in (skin, self.skin)):
            return None
        nodes, columns, _ = self._everywhere
        warmth = skin.warmth(nodes, self.history.time_s, self.wanted)
        change = np.expm1((0.0 if warmth is None else warmth) - self._warmth_at_nodes)
        change = np.broadcast_to(change, (len(self.wanted), len(nodes)))
        return np.asarray(change * np.exp(-self._sheet_change(skin, nodes).log_size) @ columns.T)

    @cached_property
    def _warmth_at_nodes(self) -> Array:
        return self._usual_warmth(self._everywhere[0])

    def _usual_warmth(self, position_m: Array) -> Array:
        """(N,) mean logarithm over the wanted frames of what warmth makes of the conductance at positions (N,2)."""
        warmth = self.skin.warmth(position_m, self.history.time_s, self.wanted)
        return np.zeros(len(position_m)) if warmth is None else warmth.mean(axis=0)

    # whole-sheet derivatives, on a coarser mesh ----------------------------------------------------------------------

    @cached_property
    def sheet_hats(self) -> Hats:
        """Coarse grid over the whole sheet on which its own field and anisotropy are resolved."""
        low, high = self.skin.sensor.extent_m
        return Hats(low, high, SHEET_GRID_M)

    @cached_property
    def _onto_hats(self) -> tuple[Array, Array]:
        """Points (N,2) all over the sheet, and the least-squares fit (H,N) of the coarse grid's hats to values there.

        A line between the grid's nodes would not be seen at them.
        """
        low, high = self.skin.sensor.extent_m
        position = Hats(low, high, SHEET_SAMPLE_M).node_m
        values = self.sheet_hats.values(position)
        return position, np.linalg.solve((values @ values.T).toarray(), values.toarray())

    @cached_property
    def sheet_derivatives(self) -> tuple[NDArray[np.float32], list[NDArray[np.float32] | None]]:
        """(P,3,H) derivatives at rest and, per patch, what the strongest press there adds to them; None at rest."""
        model = SheetModel(displaced(self.skin), COARSE)
        points = model.quadrature_m.reshape(-1, 2)
        elements = np.arange(len(model.weight_m2))
        hats = self.sheet_hats.values(points)
        sheet_state = SheetState.of(self.skin, points)
        scale = np.exp(sheet_state.log_size) / self.skin.piezo.zero_ohm_sq

        def derivative(relative: Array) -> NDArray[np.float32]:
            conductance = (scale * relative).reshape(model.weight_m2.shape)
            solution = model.solve(sheet_state.shaped(conductance), self.skin.contact_resistance_ohm)
            found = sheet_sensitivity(solution, elements, hats, self._whitening, SHEET_TENSORS, scale * relative)
            return np.ascontiguousarray(found.transpose(1, 0, 2))

        def strongest(patch: Patch) -> NDArray[np.float32] | None:
            first = self.wanted[patch.rows[0]]
            spots = self._contact[first][in_contact(self._contact, self.force_n)[first]]
            if not len(spots):
                return None
            close = np.flatnonzero(within(points, spots, self.skin.pressure.radius_m(TAIL)))
            row = self.wanted[patch.rows[int(patch.signal[patch.state_of].argmax())]]
            sheet = np.ones(len(points))
            past = patch.past_of(self.skin)
            mine = Past(past.frames, np.searchsorted(past.frames, [row]))
            sheet[close] = self._relative_at(self.skin, self.force_n, points[close], mine)[0]
            return derivative(sheet) - rest

        rest = derivative(np.ones(len(points)))
        return rest, in_threads(strongest, self.patches)

    def sheet_changes(self, change: Array) -> list[Array]:
        """Per patch, (S,P,...) change of the scans of its states for changes (3,H,...) of conductance and anisotropy on
        the coarse grid."""
        at_rest, under_press = self.sheet_derivatives
        change = change.astype(np.float32)
        even = np.tensordot(at_rest, change, 2)

        def one(number: int) -> Array:
            more, signal = under_press[number], self.patches[number].signal
            if more is None or not signal.max() > 0:
                return np.broadcast_to(even, (len(signal), *even.shape))
            share = (signal / signal.max()).astype(np.float32)
            return np.asarray(even + np.multiply.outer(share, np.tensordot(more, change, 2)))

        return in_threads(one, range(len(self.patches)))

    # evaluating ----------------------------------------------------------------------------------------------------

    def scans(self, skin: Skin, force_n: Array | None = None) -> Array:
        """(n,P) whitened scans of the wanted frames for another calibration and other effects, scan skew included."""
        force = self.force_n if force_n is None else force_n
        skew = motions(skin.effects)
        if not skew or self.protocol.injection_offset_s is None:
            return self.still_scans(skin, force)
        moments, mixing = self.skew_mixing(skew[0])
        return sum(still @ mix.T for still, mix in zip(self.skewed(skin, skew[0], force, moments), mixing, strict=True))  # type: ignore[return-value]

    def skewed(self, skin: Skin, skew: MotionEffect, force_n: Array, moments: Array) -> list[Array]:
        """Whitened scans (n,P) the skin would give standing still at each of the moments (S,) of its motion."""
        if self._moving is None or not _same_network(skin, self._moving[0]) or self._moving[1] is not force_n:
            forces = self._moved_forces(skin, skew, force_n, moments)
            about = self._moments if self._moments else [self] * len(forces)
            found = [linear.still_scans(skin, force) for linear, force in zip(about, forces, strict=True)]
            self._moving = skin, force_n, found
        return self._moving[2]

    def skew_mixing(self, skew: MotionEffect) -> tuple[Array, list[Array]]:
        """Moments (S,) of a scan and, for each, the (P,P) part it has in the scan's reciprocal coordinates."""
        if skew.straight not in self._mixing:
            moments, weights = moments_of(skew, self.protocol)
            basis, readings = self.protocol.orthonormal, self.protocol.shape[1]
            mixing = [basis.T @ (np.repeat(each, readings)[:, None] * basis) for each in weights.T]
            self._mixing[skew.straight] = moments, mixing
        return self._mixing[skew.straight]

    def _at_moments(self, progress: Progress | None) -> list[LinearSkin]:
        """Where the presses move during a scan, the skin linearised about each of the moments that scan is made of."""
        skew = motions(self.skin.effects)
        if not skew or self.protocol.injection_offset_s is None:
            return []
        moments, _ = self.skew_mixing(skew[0])
        # The mesh is that of the pads as they lie already.
        still = replace(self.skin, effects=tuple(e for e in self.skin.effects if not isinstance(e, MotionEffect)))
        forces = self._moved_forces(self.skin, skew[0], self.force_n, moments)
        return [LinearSkin(still, self.history, force, self.wanted, progress) for force in forces]

    def _moved_forces(self, skin: Skin, skew: MotionEffect, force_n: Array, moments: Array) -> list[Array]:
        """Forces (T,C) at each of the moments; the latest are remembered, for pressures are by them."""
        foam = tuple(e for e in skin.effects if isinstance(e, FoamEffect))
        key = (skew, foam, skin.pad_n_per_m, skin.support_n_per_m)
        known = next((one for one in self._moved if one[0] == key and one[1] is force_n), None)
        if known is None:
            known = key, force_n, self._forces_at(skin, skew, force_n, moments)
            self._moved = [*self._moved[1 - MOTIONS :], known]
        return known[2]

    def _forces_at(self, skin: Skin, skew: MotionEffect, force_n: Array, moments: Array) -> list[Array]:
        at_rest = skin.force_n(self.history)
        depth = skew.depth_m(self.history, moments)
        result = []
        for s in range(len(moments)):
            moved = skin.force_n(self.history, depth[:, s])
            scale = np.where(at_rest > 0, moved / np.where(at_rest > 0, at_rest, 1.0), 1.0)
            result.append(force_n * scale)
        return result

    def _memory(self, force_n: Array) -> Memory:
        """The memory of what some forces do; those of the latest motions are kept, at each of their moments."""
        known = next((one for one in self._memories if one.force_n is force_n), None)
        if known is None:
            known = Memory(force_n)
            kept = MOTIONS * max((len(forces) for _, _, forces in self._moved), default=1)
            self._memories = [*self._memories[max(0, len(self._memories) + 1 - kept) :], known]
        return known

    def still_scans(self, skin: Skin, force_n: Array) -> Array:
        """(n,P) whitened scans, every scan taken in an instant; the latest are remembered."""
        memory = self._memory(force_n)
        if memory.still is None or not _same_network(skin, memory.still[0]):
            memory.still = skin, self._still_scans(skin, force_n)
        return memory.still[1]

    def _still_scans(self, skin: Skin, force_n: Array) -> Array:
        result = np.empty((len(self.wanted), self.protocol.orthonormal.shape[1]))
        factor = skin.piezo.zero_ohm_sq / self.skin.piezo.zero_ohm_sq * self._drift(skin)
        contacts = self._contacts(skin, force_n, factor)
        moved = pad_shifts(skin) - pad_shifts(self.skin)
        self._memory(force_n).settle(skin)
        elsewhere = [part for part in (self._left_behind(skin, force_n), self._warmed(skin)) if part is not None]
        broad = self._broad_change(skin)

        def one(number: int) -> None:
            patch = self.patches[number]
            scan = patch.scans(self._change_of(number, skin, force_n), patch.contacts(*contacts, self.skin.sheet))
            if broad is not None:
                scan += broad[number][patch.state_of]
            if moved.any():
                scan += np.array([np.einsum("plc,lc->p", state.pads, moved) for state in patch.states])[patch.state_of]
            result[patch.rows] = scan

        in_threads(one, range(len(self.patches)))
        return factor[:, None] * sum(elsewhere, result)

    # derivatives by the calibration ----------------------------------------------------------------------------------

    def law_columns(self, skin: Skin, count: int) -> Array:
        """(n,P,1+count) derivatives of the scans by the logarithm of the sheet's resistance and by the law's Chebyshev
        coefficients from 1 to ``count``, its value at zero stress kept."""
        skew = motions(skin.effects)
        if not skew or self.protocol.injection_offset_s is None:
            return self._still_law_columns(skin, self.force_n, count)
        moments, mixing = self.skew_mixing(skew[0])
        forces = self._moved_forces(skin, skew[0], self.force_n, moments)
        about = self._moments if self._moments else [self] * len(forces)
        parts = (
            np.einsum("pq,nqk->npk", mix, linear._still_law_columns(skin, force, count), optimize=True)
            for linear, force, mix in zip(about, forces, mixing, strict=True)
        )
        return np.asarray(sum(parts))

    def _still_law_columns(self, skin: Skin, force_n: Array, count: int) -> Array:
        result = np.zeros((len(self.wanted), self.protocol.orthonormal.shape[1], 1 + count))
        contacts = self._contacts(skin, force_n)
        factor = skin.piezo.zero_ohm_sq / self.skin.piezo.zero_ohm_sq * self._drift(skin)
        result[..., 0] = self.still_scans(skin, force_n)
        left = self._left_behind_by_law(skin, force_n, count)

        def one(number: int) -> None:
            patch = self.patches[number]
            by_law = self._relative_by_law(skin, force_n, number, count) @ patch.directions
            mine_ohm = patch.contacts(*contacts, self.skin.sheet)
            for k, state in enumerate(patch.states):
                mine = np.flatnonzero(patch.state_of == k)
                rows = patch.rows[mine]
                # Contacts that stay as they are, in ohm, are less against a sheet of more resistance.
                result[rows, :, 0] -= mine_ohm[mine] @ state.contact[:, : mine_ohm.shape[1]].T
                result[rows, :, 1:] = (by_law[mine] @ state.local.T).transpose(0, 2, 1)

        in_threads(one, range(len(self.patches)))
        if left is not None:
            result[..., 1:] += left
        result[..., 1:] *= factor[:, None, None]
        return result

    def _relative_by_law(self, skin: Skin, force_n: Array, number: int, count: int) -> NDArray[np.float32]:
        """(m,count,G) derivatives of a patch's conductance by the law's coefficients."""
        patch = self.patches[number]
        past, position_m = patch.past_of(skin), patch.grid_m
        pressure = self._pressure(skin, force_n, position_m, past.frames)
        time_s, extent_m = self.history.time_s[past.frames], skin.sensor.extent_m
        answers = felt(skin.effects, pressure, position_m, time_s, extent_m, past.own)
        return conductance_by_law(skin.piezo, *answers, self._field_of(number, skin), count)

    def _left_behind_by_law(self, skin: Skin, force_n: Array, count: int) -> Array | None:
        """(n,P,count) derivatives of ``_left_behind`` by the law's coefficients."""
        if not skin.remembers_air:
            return None
        nodes, columns, own = self._everywhere
        pressure = self._pressure(skin, force_n, nodes, np.arange(len(force_n)))
        answers = felt(skin.effects, pressure, nodes, self.history.time_s, skin.sensor.extent_m, self.wanted)
        weight = np.where(own, 0.0, np.exp(-self._sheet_change(skin, nodes).log_size))
        change = conductance_by_law(skin.piezo, *answers, weight, count)
        return np.asarray((change @ columns.T).transpose(0, 2, 1))

    def _sheet_change(self, skin: Skin, position_m: Array) -> SheetState:
        """What another skin's effects change of the untouched sheet at positions (N,2)."""
        return SheetState.of(skin, position_m).beyond(SheetState.of(self.skin, position_m))

    def _broad_change(self, skin: Skin) -> list[Array] | None:
        """``sheet_changes`` by the effects on the sheet, remembered for the latest; None where they change nothing."""
        key = _on_sheet(skin)
        if self._latest_broad[0] != key:
            position, onto = self._onto_hats
            change = self._sheet_change(skin, position)
            found = self.sheet_changes(_stacked(change) @ onto.T) if change.differs else None
            self._latest_broad = key, found
        return self._latest_broad[1]

    def _local_field(self, skin: Skin, patch: Patch) -> Array:
        return np.asarray(np.exp(self._sheet_change(skin, patch.grid_m).log_size))

    def _field_of(self, number: int, skin: Skin) -> Array:
        """``_local_field`` of a patch, remembered for the latest effects on the sheet: most parameters leave it."""
        key = _on_sheet(skin)
        if number not in self._latest_field or self._latest_field[number][0] != key:
            self._latest_field[number] = key, self._local_field(skin, self.patches[number])
        return self._latest_field[number][1]

    def _change_of(self, number: int, skin: Skin, force_n: Array) -> NDArray[np.float32]:
        """(m,R) change of the conductance from the states' in a patch's directions, remembered for the latest law,
        memories and effects on the sheet under the pressures at hand."""
        patch, key = self.patches[number], (_of_fabric(skin), _on_sheet(skin))
        latest = self._memory(force_n).change
        if number not in latest or latest[number][0] != key:
            change = (self._relative_of(number, skin, force_n) - patch.about) * self._field_of(number, skin)
            latest[number] = key, change.astype(np.float32) @ patch.directions
        return latest[number][1]

    def _relative_of(self, number: int, skin: Skin, force_n: Array) -> Array:
        """``_relative`` of a patch, remembered for the latest law and memories under the pressures at hand."""
        key, latest = _of_fabric(skin), self._memory(force_n).relative
        if number not in latest or latest[number][0] != key:
            latest[number] = key, self._relative(skin, force_n, self.patches[number])
        return latest[number][1]

    def _relative(self, skin: Skin, force_n: Array, patch: Patch) -> Array:
        """(m,G) conductance on the patch's grid over that at rest, for the rows of the patch."""
        if not len(patch.inside):
            return np.zeros((len(patch.rows), 0))
        return self._relative_at(skin, force_n, patch.grid_m, patch.past_of(skin))

    def _relative_at(self, skin: Skin, force_n: Array, position_m: Array, past: Past) -> Array:
        pressure = self._pressure(skin, force_n, position_m, past.frames)
        fabric = skin.fabric_ohm_sq(pressure, position_m, self.history.time_s[past.frames], past.own)
        return np.asarray(skin.piezo.zero_ohm_sq / fabric)

    def _pressure(self, skin: Skin, force_n: Array, position_m: Array, frames: Indices) -> Array:
        """Pressures (n,N), remembered for the latest pressure field, mechanics and forces."""
        memory = self._memory(force_n)
        memory.settle(skin)
        key = (position_m.tobytes(), frames.tobytes())
        found = memory.pressures.get(key)
        if found is None:
            contact = skin.contact_m(self.history.contact_m[frames])
            found = skin.pressure_pa(position_m, contact, force_n[frames])
            if len(position_m) < REMEMBERED:
                memory.pressures[key] = found
        return found

    # derivatives by fields over the sheet ----------------------------------------------------------------------------

    def field_columns(self, skin: Skin, raised: Skin, by: float, fields: Fields) -> Iterator[tuple[Indices, Array]]:
        """Rows (m,) of the scans, patch by patch, and the change (m,P,K) of those by each of K ``fields``.

        ``raised`` is the skin where the field at hand is more by ``by`` everywhere. What a place does hangs on the
        field at that place alone, so its derivative everywhere is found at once; only what presses have left behind
        elsewhere is taken not to know the field.
        """
        broad = self._broad_columns(skin, raised, by, fields)
        skew = motions(skin.effects)
        moments: list[tuple[LinearSkin, Array]] = [(self, self.force_n)]
        if skew and self.protocol.injection_offset_s is not None:
            forces = self._moved_forces(skin, skew[0], self.force_n, self.skew_mixing(skew[0])[0])
            moments = list(zip(self._moments if self._moments else [self] * len(forces), forces, strict=True))
        wide = [None if broad is None else linear.sheet_changes(broad) for linear, _ in moments]

        def still(moment: int, number: int) -> Array:
            linear, force_n = moments[moment]
            local = linear._raised_by(number, skin, raised, force_n) / by
            return linear._columns_of(number, skin, local, fields, wide[moment])

        def one(number: int) -> tuple[Indices, Array]:
            rows = self.patches[number].rows
            if len(moments) == 1:
                return rows, still(0, number)
            parts = (
                np.tensordot(still(moment, number), mix.astype(np.float32), ([1], [1]))
                for moment, mix in enumerate(self.skew_mixing(skew[0])[1])
            )
            return rows, sum(parts).transpose(0, 2, 1)  # type: ignore[union-attr]

        # Moments of a moving press may share a skin, whose memories aren't for several threads at once.
        turns = in_threads_by_turns if len({id(linear) for linear, _ in moments}) == len(moments) else map
        yield from turns(one, range(len(self.patches)))

    def _raised_by(self, number: int, skin: Skin, raised: Skin, force_n: Array) -> Array:
        """(m,G) change of the relative conductance on a patch's grid from one skin to the other."""
        patch = self.patches[number]
        change = []
        for each in (skin, raised):
            self._memory(force_n).settle(each)
            relative = self._relative(each, force_n, patch)
            change.append((relative - patch.about) * self._local_field(each, patch))
        return np.asarray(change[1] - change[0])

    def _columns_of(self, number: int, skin: Skin, local: Array, fields: Fields, wide: list[Array] | None) -> Array:
        """(m,P,K) ``field_columns`` of a patch, every scan taken in an instant, from the derivative (m,G) of its
        conductance by an even field, and what the fields do on the coarse grid, (S,P,K) for each patch.

        What a field does at the same place under other loads differs little: few of its forms are spread over fields.
        """
        patch = self.patches[number]
        values = fields(patch.grid_m).astype(np.float32)
        result = np.zeros((len(patch.rows), self.protocol.orthonormal.shape[1], values.shape[1]), dtype=np.float32)
        share, form = main_forms(local)
        along = np.array([patch.directions.T @ (one[:, None] * values) for one in form])
        for k, state in enumerate(patch.states):
            mine = np.flatnonzero(patch.state_of == k)
            if len(form):
                result[mine] = state.local @ np.tensordot(share[mine], along, 1)
            if wide is not None:
                result[mine] += wide[number][k]
        factor = skin.piezo.zero_ohm_sq / self.skin.piezo.zero_ohm_sq * self._drift(skin)[patch.rows]
        result *= factor[:, None, None].astype(np.float32)
        return cast(Array, result)  # in single precision

    def _broad_columns(self, skin: Skin, raised: Skin, by: float, fields: Fields) -> Array | None:
        """(3,H,K) what each of K fields changes of conductance and anisotropy on the coarse grid; None for nothing."""
        position, onto = self._onto_hats
        before, after = (_stacked(self._sheet_change(each, position)) for each in (skin, raised))
        if not (after - before).any():
            return None
        values = fields(position)
        changed = np.zeros((len(before), len(onto), values.shape[1]))
        for number, part in enumerate((after - before) / by):
            if part.any():
                changed[number] = onto @ (part[:, None] * values)
        return changed

    def contact_columns(self, skin: Skin, scaled: Skin) -> NDArray[np.float32]:
        """(n,P,L) change of the scans, electrode by electrode, by contacts as of ``scaled`` instead of ``skin``."""
        before, after = (self._contacts(each, self.force_n) for each in (skin, scaled))
        result = np.zeros((*self.wanted.shape, *self.patches[0].states[0].pads.shape[:2]), dtype=np.float32)
        for patch in self.patches:
            change = patch.contacts(*after, self.skin.sheet) - patch.contacts(*before, self.skin.sheet)
            result[patch.rows] = patch.by_electrode(change)
        return result

    def _contacts(self, skin: Skin, force_n: Array, factor: Array | float = 1.0) -> tuple[Array, Array | None]:
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

    def _drift(self, skin: Skin) -> Array:
        return skin.drift(self.history.time_s)[self.wanted]
