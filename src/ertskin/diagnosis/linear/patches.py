"""Places of a recording: frames that share their contacts, what counts as their past, the states solved for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.diagnosis.linear.pad_shunts import conducting, uneven
from ertskin.diagnosis.linear.sensitivity import Hats
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ALIKE = 0.05
"""States whose changes of conductance differ by less than this part share a solution."""
CONTACTS_ALIKE = 0.3
"""Logarithms of contact resistances that differ by less share a solution where nothing presses: what a pad shunts, all
that an electrode shows that isn't read while driven, follows its resistance nearly, not quite."""
NEGLIGIBLE = 1e-5
"""Part of the largest singular value below which forms are left out of rows: single precision keeps little more."""


@dataclass(frozen=True, eq=False)
class State:
    """One solution: whitened scan (P,) in volt, less what contacts in series make of it, and its derivatives.

    ``local`` (P,R) by the relative conductance in the patch's directions; ``contact`` (P,K) by the ``contacts`` (K,)
    as ``Patch.contacts`` has them; ``pads`` (P,L,2) by their shifts, volt per metre.
    """

    scan: Array
    relative: Array
    contacts: Array
    local: NDArray[np.float32]
    contact: Array
    pads: Array


@dataclass(frozen=True, eq=False)
class Solutions:
    """The ``states`` solved at one place, and the ``directions`` (G,R) of its grid that their derivatives see."""

    states: list[State]
    directions: NDArray[np.float32]

    @cached_property
    def together(self) -> tuple[Array, NDArray[np.float32], Array, Array]:
        """The states' scans (S,P), derivatives ``local`` (S,P,R) and ``contact`` (S,P,K), and ``contacts`` (S,K)."""
        scan, local, contact, now = zip(*((s.scan, s.local, s.contact, s.contacts) for s in self.states), strict=True)
        return np.stack(scan), np.stack(local), np.stack(contact), np.stack(now)

    @cached_property
    def signal(self) -> Array:
        """(S,) how much each state changes of the conductance."""
        return np.array([np.abs(state.relative - 1).sum() for state in self.states])


@dataclass(frozen=True, eq=False)
class Past:
    """Frames (n,), in recording order, that count for memories at a place, and where among them its own (m,) are."""

    frames: Indices
    own: Indices


@dataclass(frozen=True, eq=False)
class Patch:
    """The surroundings of one set of contacts, pressed by forces of one moment.

    ``rows`` (m,) which of the wanted frames have these contacts; ``past`` what counts for memories there, ``since_air``
    the same where air clears them; ``grid_m`` (G,2); ``leaning`` (q,) electrodes within reach; ``solutions`` of the
    place and ``state_of`` (m,) which state each row uses.
    """

    rows: Indices
    past: Past
    since_air: Past
    hats: Hats
    inside: Indices
    leaning: Indices
    solutions: Solutions
    state_of: Indices

    @property
    def states(self) -> list[State]:
        """The states solved here."""
        return self.solutions.states

    @property
    def derivatives(self) -> int:
        """How many derivatives of a scan's numbers a state holds: by the grid's nodes, contacts and shifts of pads."""
        state = self.states[0]
        return len(state.scan) * len(self.inside) + state.contact.size + state.pads.size

    @cached_property
    def grid_m(self) -> Array:
        """(G,2) nodes of the grid."""
        return self.hats.node_m[self.inside]

    @cached_property
    def about(self) -> Array:
        """(m,G) relative conductance of each row's state."""
        return np.reshape([state.relative for state in self.states], (len(self.states), -1))[self.state_of]

    def contacts(self, ohm: Array, share: Array | None, model: SheetModel, pad_ohm: Array) -> Array:
        """(m,K) contacts of its rows, from those of all frames: what resistances (n,L) and their pads' (L,) are
        ``conducting``, then for each electrode within reach by what an ``uneven`` one shows times how it leans (J,),
        from what the cells of the ``model``'s contacts conduct (n,C). The former alone where every contact is even.
        """
        mine = ohm[self.rows]
        shunts = conducting(mine, pad_ohm)
        if share is None:
            return shunts
        by = uneven(mine, pad_ohm)
        each = [by[:, k, None] * model.contacts[k].lean(share[self.rows, model.cells[k]]) for k in self.leaning]
        return np.hstack([shunts, *each])

    def contacts_per_logarithm(self, ohm: Array, share: Array | None, model: SheetModel, pad_ohm: Array) -> Array:
        """(m,K) derivatives of ``contacts`` by the logarithm of all resistances."""
        shunts, lean = np.split(self.contacts(ohm, share, model, pad_ohm), [ohm.shape[1]], axis=1)
        forms = lean.shape[1] // max(len(self.leaning), 1)
        part = np.repeat((pad_ohm * shunts)[:, self.leaning], forms, axis=1)
        return np.hstack([-ohm[self.rows] * shunts**2, part * lean])

    def by_electrode(self, change: Array) -> NDArray[np.float32]:
        """(m,P,L) what changes of its rows' ``contacts`` (m,K) do to the scans, electrode by electrode."""
        electrodes = self.states[0].pads.shape[1]
        result = np.zeros((len(self.rows), *self.states[0].pads.shape[:2]), dtype=np.float32)
        of_lean = np.split(np.arange(electrodes, change.shape[1]), max(len(self.leaning), 1))
        for number, state in enumerate(self.states):
            mine = np.flatnonzero(self.state_of == number)
            result[mine] = state.contact[:, :electrodes] * change[mine, None, :electrodes]
            for k, columns in zip(self.leaning, of_lean, strict=False):
                result[mine, :, k] += change[mine][:, columns] @ state.contact[:, columns].T
        return result

    def scans(self, change: NDArray[np.float32], contacts: Array) -> Array:
        """(m,P) whitened scans, less what contacts in series make of them, for a change (m,R) of the conductance in the
        patch's directions from the states', and ``contacts`` (m,K)."""
        result = np.empty((len(self.rows), len(self.states[0].scan)))
        _from_states(result, self.state_of, *self.solutions.together, change, contacts)
        return result

    def past_of(self, skin: Skin) -> Past:
        """The frames that a skin's effects remember."""
        return self.past if any(getattr(e, "remembers_air", False) for e in skin.effects) else self.since_air


def main_directions(rows: NDArray[np.float32], rank: int) -> NDArray[np.float32]:
    """(G,R) orthonormal directions that hold nearly all of rows (n,G): a randomised range finder, one power step.

    After Halko, Martinsson and Tropp, SIAM Review 53 (2011) 217.
    """
    width = min(rank, *rows.shape)
    if width == rows.shape[1]:
        return np.eye(width, dtype=np.float32)
    start = np.random.default_rng(0).standard_normal((len(rows), width)).astype(np.float32)
    found = np.linalg.qr(rows.T @ start)[0]
    return np.asarray(np.linalg.qr(rows.T @ (rows @ found))[0])


def main_forms(rows: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Shares (m,q) and forms (q,G) whose products are the rows (m,G), but for ``NEGLIGIBLE`` of the largest."""
    share, size, form = np.linalg.svd(rows, full_matrices=False)
    kept = size > NEGLIGIBLE * size.max(initial=0.0)
    return (share[:, kept] * size[kept]).astype(np.float32), form[kept].astype(np.float32)


def followers(relative: Array, contacts: Array, usual: Array) -> tuple[Indices, list[int]]:
    """Which leader each row follows (n,), and the rows that lead.

    By ``relative`` (n,G) conductance and ``contacts`` (n,L) in ohm, which are ``usual`` (L,) at rest; how uneven one is
    hangs on how much less it resists. Where nothing presses, by the contacts alone.
    """
    if not relative.shape[1]:
        change = np.log(contacts)
        return _led(lambda leaders, k: np.abs(change[leaders] - change[k]).max(axis=1), len(change), CONTACTS_ALIKE)
    change = np.hstack([relative - 1, 0.2 * (contacts / usual - 1)])
    near = ALIKE * np.maximum(np.sqrt((change**2).sum(axis=1)), 1e-6)

    def apart(leaders: list[int], k: int) -> Array:
        return np.asarray(np.sqrt(((change[leaders] - change[k]) ** 2).sum(axis=1)) / near[k])

    return _led(apart, len(change), 1.0)


def _led(apart: Callable[[list[int], int], Array], count: int, near: float) -> tuple[Indices, list[int]]:
    """Which leader each of so many rows follows, and those that lead: each that is ``near`` none before it."""
    leaders: list[int] = []
    state_of = np.zeros(count, dtype=np.intp)
    for k in range(count):
        distance = apart(leaders, k) if leaders else np.array([np.inf])
        if distance.min() >= near:
            leaders.append(k)
            state_of[k] = len(leaders) - 1
        else:
            state_of[k] = distance.argmin()
    return state_of, leaders


@njit(cache=True, nogil=True, fastmath=True)
def _from_states(result, state_of, scan, local, contact, about, change, contacts):  # type: ignore[no-untyped-def]
    for row in range(len(result)):
        state = state_of[row]
        apart = contacts[row] - about[state, : contacts.shape[1]]
        for p in range(result.shape[1]):
            by_place = np.float32(0.0)
            for k in range(change.shape[1]):
                by_place += local[state, p, k] * change[row, k]
            total = scan[state, p] + by_place
            for k in range(len(apart)):
                total += contact[state, p, k] * apart[k]
            result[row, p] = total
