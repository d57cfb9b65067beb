"""A skin linearised about the states its recording visits: scans for other parameters without solving again.

What a parameter does to the sheet's conductance near the contacts is computed exactly, on a small grid around them;
only conduction is linear, about a solution of the nearest state, and for what presses have left behind elsewhere, about
rest. Contacts follow their resistances in closed form (``pad_shunts``). Everything is in whitened coordinates (volt).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.cores import in_threads, in_threads_by_turns
from ertskin.diagnosis.linear.elsewhere import Elsewhere
from ertskin.diagnosis.linear.law_derivatives import conductance_by_law
from ertskin.diagnosis.linear.patches import Indices, Patch, main_forms
from ertskin.diagnosis.linear.pressed_frames import PressedFrames, motions, of_fabric
from ertskin.diagnosis.linear.sensitivity import Potentials
from ertskin.diagnosis.linear.sheet_state import pad_shifts
from ertskin.diagnosis.linear.solved_states import Progress, StateSolver, UntouchedSheet
from ertskin.diagnosis.linear.whole_sheet import Fields, WholeSheet, on_sheet
from ertskin.physics.effects.effect import Effect, MotionEffect, Stage
from ertskin.physics.effects.piezo_chain import felt, response_power
from ertskin.physics.history import History
from ertskin.physics.skin import Skin, moments_of

Array = NDArray[np.float64]


def _same_network(one: Skin, other: Skin | None) -> bool:
    """Whether two skins of one family differ by what acts on their readings alone."""
    if one is other:
        return True
    return (
        other is not None
        and one.pressure is other.pressure
        and one.piezo.zero_ohm_sq == other.piezo.zero_ohm_sq
        and _of_network(one) == _of_network(other)
        and of_fabric(one) == of_fabric(other)
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
        self._latest_field: dict[int, tuple[object, Array]] = {}
        self._moving: tuple[Skin, Array, list[Array]] | None = None
        self._mixing: dict[bool, list[Array]] = {}
        self.frames = PressedFrames(skin, history, force_n, self.wanted)
        moments, forces = self._forces_at(skin, force_n)
        untouched = UntouchedSheet(self.frames)
        states = StateSolver(untouched)
        self.patches, *moved = states.patches([force_n, *forces], progress or (lambda share, text: None))
        self._patches_at = dict(zip(moments, moved, strict=True))
        self._by_series, self._pad_ohm = states.by_series, states.pad_ohm
        self.sheet = WholeSheet(self.frames, self.patches)
        self._elsewhere = Elsewhere(untouched, Potentials.of(states.rest), self.patches, self.sheet)

    def _forces_at(self, skin: Skin, force_n: Array) -> tuple[list[float], list[Array]]:
        """The moments of a scan at which presses that move are looked at, and the forces (T,C) then; none where nothing
        moves."""
        skew = self._motion(skin)
        if skew is None:
            return [], []
        moments = moments_of(skew, self.protocol)[0]
        return moments.tolist(), self.frames.moved_forces(skin, skew, force_n, moments)

    def _motion(self, skin: Skin) -> MotionEffect | None:
        """How a skin's presses move during a scan, where its injections are timed; None where they don't."""
        return next(iter(motions(skin.effects)), None) if self.protocol.timed else None

    @property
    def derivatives(self) -> int:
        """How many derivatives, each of one number of a scan, all states solved hold: what linearising takes."""
        return sum(len(patch.states) * patch.derivatives for patch in self.patches)

    def instants(self, skin: Skin) -> int:
        """At how many moments of every scan a skin is looked at: one, unless presses move while it is taken."""
        return max(1, len(self._moments(skin, self.force_n)))

    def _factor(self, skin: Skin) -> Array:
        """(n,) a skin's sheet resistance in the wanted frames over that linearised about."""
        return skin.piezo.zero_ohm_sq / self.skin.piezo.zero_ohm_sq * self.frames.drift(skin)

    # evaluating ----------------------------------------------------------------------------------------------------

    def scans(self, skin: Skin, force_n: Array | None = None) -> Array:
        """(n,P) whitened scans of the wanted frames for another calibration and other effects, scan skew included."""
        force, skew = self.force_n if force_n is None else force_n, self._motion(skin)
        if skew is None:
            return self.still_scans(skin, force)
        return sum(still @ mix.T for still, mix in zip(self.skewed(skin, force), self.mixing(skew), strict=True))  # type: ignore[return-value]

    def skewed(self, skin: Skin, force_n: Array) -> list[Array]:
        """Whitened scans (n,P) the skin would give standing still at each of the moments (S,) of its motion."""
        if self._moving is None or not _same_network(skin, self._moving[0]) or self._moving[1] is not force_n:
            self._moving = skin, force_n, [self.still_scans(skin, *moment) for moment in self._moments(skin, force_n)]
        return self._moving[2]

    def mixing(self, skew: MotionEffect) -> list[Array]:
        """For each of the moments (S,) of a scan the (P,P) part it has in the scan's reciprocal coordinates."""
        if skew.straight not in self._mixing:
            basis, readings = self.protocol.orthonormal, self.protocol.shape[1]
            weights = moments_of(skew, self.protocol)[1]
            self._mixing[skew.straight] = [basis.T @ (np.repeat(each, readings)[:, None] * basis) for each in weights.T]
        return self._mixing[skew.straight]

    def _moments(self, skin: Skin, force_n: Array) -> list[tuple[Array, list[Patch]]]:
        """Forces (T,C) at each of the moments of a skin's motion, and the patches about which it is linear then."""
        return [
            (force, self._patches_at.get(moment, self.patches))
            for moment, force in zip(*self._forces_at(skin, force_n), strict=True)
        ]

    def still_scans(self, skin: Skin, force_n: Array, patches: list[Patch] | None = None) -> Array:
        """(n,P) whitened scans, every scan taken in an instant; the latest are remembered."""
        memory = self.frames.memory(force_n)
        if memory.still is None or not _same_network(skin, memory.still[0]):
            memory.still = skin, self._still_scans(skin, force_n, self.patches if patches is None else patches)
        return memory.still[1]

    def _still_scans(self, skin: Skin, force_n: Array, patches: list[Patch]) -> Array:
        result = np.empty((len(self.wanted), self.protocol.orthonormal.shape[1]))
        factor = self._factor(skin)
        contacts = self.frames.contacts(skin, force_n, factor)
        moved = pad_shifts(skin) - pad_shifts(self.skin)
        self.frames.memory(force_n).settle(skin)
        elsewhere = self._elsewhere.change(skin, force_n)
        broad = self.sheet.change_by(skin)

        def one(number: int) -> None:
            patch = patches[number]
            change = self._change_of(number, patch, skin, force_n)
            scan = patch.scans(change, patch.contacts(*contacts, self.skin.sheet, self._pad_ohm))
            if broad is not None:
                scan += broad[number][patch.state_of]
            if moved.any():
                scan += np.array([np.einsum("plc,lc->p", state.pads, moved) for state in patch.states])[patch.state_of]
            result[patch.rows] = scan

        in_threads(one, range(len(patches)))
        return factor[:, None] * sum(elsewhere, result + contacts[0] @ self._by_series.T)

    # derivatives by the calibration ----------------------------------------------------------------------------------

    def law_columns(self, skin: Skin, count: int) -> Array:
        """(n,P,1+count) derivatives of the scans by the logarithm of the sheet's resistance and by the law's Chebyshev
        coefficients from 1 to ``count``, its value at zero stress kept."""
        skew = self._motion(skin)
        if skew is None:
            return self._still_law_columns(skin, self.force_n, self.patches, count)
        parts = (
            np.einsum("pq,nqk->npk", mix, self._still_law_columns(skin, *moment, count), optimize=True)
            for moment, mix in zip(self._moments(skin, self.force_n), self.mixing(skew), strict=True)
        )
        return np.asarray(sum(parts))

    def _still_law_columns(self, skin: Skin, force_n: Array, patches: list[Patch], count: int) -> Array:
        result = np.zeros((len(self.wanted), self.protocol.orthonormal.shape[1], 1 + count))
        factor = self._factor(skin)
        ohm, share = self.frames.contacts(skin, force_n, factor)
        # Contacts that stay as they are, in ohm, are less against a sheet of more resistance.
        result[..., 0] = self.still_scans(skin, force_n, patches)
        result[..., 0] -= factor[:, None] * (ohm @ self._by_series.T)
        left = self._elsewhere.by_law(skin, force_n, count)

        def one(number: int) -> None:
            patch = patches[number]
            by_law = self._relative_by_law(number, patch, skin, force_n, count) @ patch.solutions.directions
            per_log = patch.contacts_per_logarithm(ohm, share, self.skin.sheet, self._pad_ohm)
            for k, state in enumerate(patch.states):
                mine = np.flatnonzero(patch.state_of == k)
                rows = patch.rows[mine]
                result[rows, :, 0] -= factor[rows, None] * (per_log[mine] @ state.contact[:, : per_log.shape[1]].T)
                result[rows, :, 1:] = (by_law[mine] @ state.local.T).transpose(0, 2, 1)

        in_threads(one, range(len(patches)))
        if left is not None:
            result[..., 1:] += left
        result[..., 1:] *= factor[:, None, None]
        return result

    def _relative_by_law(
        self, number: int, patch: Patch, skin: Skin, force_n: Array, count: int
    ) -> NDArray[np.float32]:
        """(m,count,G) derivatives of a patch's conductance by the law's coefficients."""
        past, position_m = patch.past_of(skin), patch.grid_m
        pressure = self.frames.pressure(skin, force_n, position_m, past.frames)
        time_s, extent_m = self.history.time_s[past.frames], skin.sensor.extent_m
        answers = felt(skin.effects, pressure, position_m, time_s, extent_m, past.own)
        power = response_power(skin.effects, position_m, extent_m)
        return conductance_by_law(skin.piezo, *answers, self._field_of(number, skin), count, power)

    def _local_field(self, skin: Skin, patch: Patch) -> Array:
        return np.asarray(np.exp(self.sheet.beyond(skin, patch.grid_m).log_size))

    def _field_of(self, number: int, skin: Skin) -> Array:
        """``_local_field`` of a patch, remembered for the latest effects on the sheet: most parameters leave it."""
        key = on_sheet(skin)
        if number not in self._latest_field or self._latest_field[number][0] != key:
            self._latest_field[number] = key, self._local_field(skin, self.patches[number])
        return self._latest_field[number][1]

    def _change_of(self, number: int, patch: Patch, skin: Skin, force_n: Array) -> NDArray[np.float32]:
        """(m,R) change of the conductance from the states' in a patch's directions, remembered for the latest law,
        memories and effects on the sheet under the pressures at hand."""
        key, latest = (of_fabric(skin), on_sheet(skin)), self.frames.memory(force_n).change
        if number not in latest or latest[number][0] != key:
            relative = self.frames.relative_of(number, patch, skin, force_n)
            change = (relative - patch.about) * self._field_of(number, skin)
            latest[number] = key, change.astype(np.float32) @ patch.solutions.directions
        return latest[number][1]

    # derivatives by fields over the sheet ----------------------------------------------------------------------------

    def field_columns(self, skin: Skin, raised: Skin, by: float, fields: Fields) -> Iterator[tuple[Indices, Array]]:
        """Rows (m,) of the scans, patch by patch, and the change (m,P,K) of those by each of K ``fields``.

        ``raised`` is the skin where the field at hand is more by ``by`` everywhere. What a place does hangs on the
        field at that place alone, so its derivative everywhere is found at once; only what presses have left behind
        elsewhere is taken not to know the field.
        """
        broad = self.sheet.columns(skin, raised, by, fields)
        wide = None if broad is None else self.sheet.changes(broad)
        skew, moments = self._motion(skin), self._moments(skin, self.force_n)
        # What they remember is begun before several threads ask for it.
        for force_n in (self.force_n, *(force_n for force_n, _ in moments)):
            self.frames.memory(force_n)

        def still(number: int, force_n: Array, patches: list[Patch]) -> Array:
            local = self._raised_by(patches[number], skin, raised, force_n) / by
            return self._columns_of(patches[number], skin, local, fields, None if wide is None else wide[number])

        def one(number: int) -> tuple[Indices, Array]:
            rows = self.patches[number].rows
            if skew is None:
                return rows, still(number, self.force_n, self.patches)
            parts = (
                np.tensordot(still(number, *moment), mix.astype(np.float32), ([1], [1]))
                for moment, mix in zip(moments, self.mixing(skew), strict=True)
            )
            return rows, sum(parts).transpose(0, 2, 1)  # type: ignore[union-attr]

        yield from in_threads_by_turns(one, range(len(self.patches)))

    def _raised_by(self, patch: Patch, skin: Skin, raised: Skin, force_n: Array) -> Array:
        """(m,G) change of the relative conductance on a patch's grid from one skin to the other."""
        change = []
        for each in (skin, raised):
            self.frames.memory(force_n).settle(each)
            relative = self.frames.relative(each, force_n, patch)
            change.append((relative - patch.about) * self._local_field(each, patch))
        return np.asarray(change[1] - change[0])

    def _columns_of(self, patch: Patch, skin: Skin, local: Array, fields: Fields, wide: Array | None) -> Array:
        """(m,P,K) ``field_columns`` of a patch, every scan taken in an instant, from the derivative (m,G) of its
        conductance by an even field, and what the fields do on the coarse grid to its states, (S,P,K).

        What a field does at the same place under other loads differs little: few of its forms are spread over fields.
        """
        values = fields(patch.grid_m).astype(np.float32)
        result = np.zeros((len(patch.rows), self.protocol.orthonormal.shape[1], values.shape[1]), dtype=np.float32)
        share, form = main_forms(local)
        along = np.array([patch.solutions.directions.T @ (one[:, None] * values) for one in form])
        for k, state in enumerate(patch.states):
            mine = np.flatnonzero(patch.state_of == k)
            if len(form):
                result[mine] = state.local @ np.tensordot(share[mine], along, 1)
            if wide is not None:
                result[mine] += wide[k]
        factor = self._factor(skin)[patch.rows]
        result *= factor[:, None, None].astype(np.float32)
        return cast(Array, result)  # in single precision

    def contact_columns(self, skin: Skin, scaled: Skin) -> NDArray[np.float32]:
        """(n,P,L) change of the scans, electrode by electrode, by contacts as of ``scaled`` instead of ``skin``."""
        factor = self._factor(skin)
        before, after = (self.frames.contacts(each, self.force_n, factor) for each in (skin, scaled))
        result = (self._by_series * (after[0] - before[0])[:, None]).astype(np.float32)
        for patch in self.patches:
            one, other = (patch.contacts(*each, self.skin.sheet, self._pad_ohm) for each in (before, after))
            result[patch.rows] += patch.by_electrode(other - one)
        result *= factor[:, None, None].astype(np.float32)
        return cast(NDArray[np.float32], result)
