"""What changes the sheet as a whole does to scans: derivatives on a coarser mesh, at rest and under presses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ertskin.cores import in_threads
from ertskin.diagnosis.linear.patches import Past, Patch
from ertskin.diagnosis.linear.pressed_frames import PressedFrames
from ertskin.diagnosis.linear.sensitivity import Hats, sheet_sensitivity, whitening_of_transfer
from ertskin.diagnosis.linear.sheet_state import SheetState, displaced
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.contacts import within
from ertskin.physics.effects.effect import Effect, SheetEffect
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

SHEET_GRID_M = 5e-3
SHEET_SAMPLE_M = 1.5e-3
"""Spacing of the points at which a field of the sheet is read, to be spread over the grid ``SHEET_GRID_M``."""
COARSE = Resolution(2, Grading(cell_m=5e-3, rim_m=5e-4, growth=7.0, spread=0.7))
"""Mesh for derivatives by what changes the whole sheet: good to a percent of them."""
SHEET_TENSORS = np.array([[1.0, 0.0, 1.0], [0.5, 0.0, -0.5], [0.0, 0.5, 0.0]])
"""Scalar change of conductance and the two derivatives of the anisotropic tensor at isotropy."""

Fields = Callable[[Array], Array]
"""Values (N,K) of K fields at positions (N,2)."""


def on_sheet(skin: Skin) -> tuple[Effect, ...]:
    """The effects on the sheet as a whole: what most parameters leave alone."""
    return tuple(e for e in skin.effects if isinstance(e, SheetEffect))


def _stacked(change: SheetState) -> Array:
    """(3,N) relative change of the conductance, and of the anisotropy along x and along the diagonal."""
    return np.vstack([np.expm1(change.log_size), change.stretch.T])


def _hats(box_m: tuple[float, ...]) -> Hats:
    low_m, high_m = np.reshape(box_m, (2, 2))
    return Hats(low_m, high_m, SHEET_GRID_M)


@lru_cache(maxsize=1)
def _onto_hats(box_m: tuple[float, ...]) -> tuple[Array, Array]:
    """Points (N,2) all over a sheet's box, and the least-squares fit (H,N) of the coarse grid's hats to values there.

    A line between the grid's nodes would not be seen at them.
    """
    low_m, high_m = np.reshape(box_m, (2, 2))
    position_m = Hats(low_m, high_m, SHEET_SAMPLE_M).node_m
    values = _hats(box_m).values(position_m)
    return position_m, np.linalg.solve((values @ values.T).toarray(), values.toarray())


class WholeSheet:
    """First-order change of the scans of ``patches`` by fields over the whole sheet and its anisotropy.

    Where presses move during a scan the patches are those of presses that stand still; states solved for a moment that
    presses more than any frame does are as much stronger as they change more of the conductance.
    """

    def __init__(self, frames: PressedFrames, patches: Sequence[Patch]) -> None:
        self.frames, self.patches, self.skin = frames, patches, frames.skin
        self._box_m = tuple(map(float, frames.skin.sensor.extent_m.ravel()))
        self._latest: tuple[object, list[Array] | None] = (None, None)

    def beyond(self, skin: Skin, position_m: Array) -> SheetState:
        """What another skin's effects change of the untouched sheet at positions (N,2)."""
        return SheetState.of(skin, position_m).beyond(SheetState.of(self.skin, position_m))

    def change_by(self, skin: Skin) -> list[Array] | None:
        """``changes`` by the effects on the sheet, remembered for the latest; None where they change nothing."""
        key = on_sheet(skin)
        if self._latest[0] != key:
            position, onto = _onto_hats(self._box_m)
            change = self.beyond(skin, position)
            self._latest = key, self.changes(_stacked(change) @ onto.T) if change.differs else None
        return self._latest[1]

    def columns(self, skin: Skin, raised: Skin, by: float, fields: Fields) -> Array | None:
        """(3,H,K) what each of K fields changes of conductance and anisotropy on the coarse grid, those of the effect
        by which ``raised`` is more ``by`` so much everywhere; None for nothing."""
        position, onto = _onto_hats(self._box_m)
        before, after = (_stacked(self.beyond(each, position)) for each in (skin, raised))
        if not (after - before).any():
            return None
        values = fields(position)
        changed = np.zeros((len(before), len(onto), values.shape[1]))
        for number, part in enumerate((after - before) / by):
            if part.any():
                changed[number] = onto @ (part[:, None] * values)
        return changed

    def changes(self, change: Array) -> list[Array]:
        """Per patch, (S,P,...) change of the scans of its states for changes (3,H,...) of conductance and anisotropy on
        the coarse grid."""
        at_rest, under_press = self.derivatives
        change = change.astype(np.float32)
        even = np.tensordot(at_rest, change, 2)

        def one(number: int) -> Array:
            more, patch = under_press[number], self.patches[number]
            signal = patch.solutions.signal
            strongest = signal[patch.state_of].max()
            if more is None or not strongest > 0:
                return np.broadcast_to(even, (len(signal), *even.shape))
            share = (signal / strongest).astype(np.float32)
            return np.asarray(even + np.multiply.outer(share, np.tensordot(more, change, 2)))

        return in_threads(one, range(len(self.patches)))

    @cached_property
    def hats(self) -> Hats:
        """Coarse grid over the whole sheet on which its own field and anisotropy are resolved."""
        return _hats(self._box_m)

    @cached_property
    def derivatives(self) -> tuple[NDArray[np.float32], list[NDArray[np.float32] | None]]:
        """(P,3,H) derivatives at rest and, per patch, what the strongest press there adds to them; None at rest."""
        frames, model = self.frames, SheetModel(displaced(self.skin), COARSE)
        points = model.quadrature_m.reshape(-1, 2)
        elements = np.arange(len(model.weight_m2))
        hats, whitening = self.hats.values(points), whitening_of_transfer(self.skin.protocol)
        sheet_state = SheetState.of(self.skin, points)
        scale = np.exp(sheet_state.log_size) / self.skin.piezo.zero_ohm_sq

        def derivative(relative: Array) -> NDArray[np.float32]:
            conductance = (scale * relative).reshape(model.weight_m2.shape)
            solution = model.solve(sheet_state.shaped(conductance), self.skin.contact_resistance_ohm)
            found = sheet_sensitivity(solution, elements, hats, whitening, SHEET_TENSORS, scale * relative)
            return np.ascontiguousarray(found.transpose(1, 0, 2))

        def strongest(patch: Patch) -> NDArray[np.float32] | None:
            spots = frames.spots_m(patch.rows)
            if not len(spots):
                return None
            close = np.flatnonzero(within(points, spots, frames.reach_m))
            row = frames.wanted[patch.rows[int(patch.solutions.signal[patch.state_of].argmax())]]
            sheet = np.ones(len(points))
            past = patch.past_of(self.skin)
            mine = Past(past.frames, np.searchsorted(past.frames, [row]))
            sheet[close] = frames.relative_at(self.skin, frames.force_n, points[close], mine)[0]
            return derivative(sheet) - rest

        rest = derivative(np.ones(len(points)))
        return rest, in_threads(strongest, self.patches)
