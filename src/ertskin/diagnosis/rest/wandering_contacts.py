"""Contacts that wander from frame to frame, or settle together, while nothing presses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.rest.growing_contacts import ScanOf, grown
from ertskin.diagnosis.rest.settling_contacts import NONE_SETTLES, Settling, settling_contacts
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.registry import measured_as

Array = NDArray[np.float64]

LEAST_LEFT = 0.02
"""Part of a contact's mean resistance that a path must leave of it."""
NEAR = 0.3
"""Share of a contact's resistance up to which its path is read off the slope at the mean."""
ENOUGH_RESTS = 5
LEFT, ALONE = 0.2, 0.3
"""Parts of what changes between rest frames: left by all restless contacts, explained by one."""
FEW_OF = 4
"""Of so many contacts one, at least, makes few of them."""
HARDLY, FEWEST = 3.0, 3
"""Times the error of the frames that tell a contact well from which on one hardly does; fewest frames that go
anywhere."""
CURVED = 0.5
"""Part of the mean square of a far path by which its course may be off before the sheet is solved."""
SURELY = 5.0
"""Standard deviations of chance above which more than the contacts has changed."""


class Drifting(NamedTuple):
    """Paths of contacts as ``effects``, those of electrodes ``settling`` settle together, and what all the contacts
    (L,) have without them."""

    effects: tuple[Effect, ...]
    settling: frozenset[int]
    usual_ohm: Array


def contact_drift(
    change_v: Array,
    time_s: Array,
    run: NDArray[np.intp],
    noise_v: float,
    columns: Array,
    traces: Array,
    contacts: Array,
    criteria: Criteria,
    scan_of: ScanOf,
    doubt: float = 0.0,
    settling: Settling = NONE_SETTLES,
) -> Drifting:
    """What each contact did over the recording, from its rest frames, where they wander beyond noise and ``doubt``, or
    settle together where nothing else is in doubt and no places recover; those ``settling`` are known to.

    ``run`` (R,) numbers the rest frames' runs between presses. A contact that is another one in every run has no path
    that pressed frames could differ from: that is noise. Of fewer than five runs nothing tells the two apart, and a
    contact that isn't the same in them drifts. ``scan_of`` contacts in ohm, in volt: one that settles far is followed
    on the sheet solved in full.
    """
    if len(change_v) < ENOUGH_RESTS:
        return Drifting((), frozenset(), contacts)
    seen = each_moved(change_v, noise_v, columns, traces)
    free = [trace @ trace.T for trace in traces]
    rest = np.stack([c - p @ c for c, p in zip(change_v / noise_v, free, strict=True)])
    designs = [columns - p @ columns for p in free]
    # Places that recover settle too, and so does what has been taken off before.
    surely = not traces.any() and not doubt
    found = settling_contacts(rest, [d / noise_v for d in designs], time_s) if surely else settling
    settled_ohm = _settled_ohm(found, change_v, seen, columns, contacts, noise_v, scan_of, criteria)
    usual_ohm = contacts.copy()
    usual_ohm[list(settled_ohm)] = [ohm.mean() for ohm in settled_ohm.values()]
    taken = traces.any(axis=1).sum(axis=1).tolist()
    if settling.size:
        # What all the others change by is warmth's.
        left_v = change_v - settling.done(columns)
        rest, seen = left_v / noise_v, each_moved(left_v, noise_v, columns, traces)
    paths = _paths(seen, run, partial(wandering, rest, designs, taken, doubt=doubt), criteria)
    return Drifting(_drifts(paths, settled_ohm, usual_ohm, time_s), frozenset(settled_ohm), usual_ohm)


def _drifts(
    paths: dict[int, Array], settled_ohm: dict[int, Array], usual_ohm: Array, time_s: Array
) -> tuple[Effect, ...]:
    """Contacts that wander, by shares of their resistance, and those that settle, by their resistance."""
    drift_ohm = {k: usual_ohm[k] * path for k, path in paths.items()}
    drift_ohm |= {k: ohm - usual_ohm[k] for k, ohm in settled_ohm.items()}
    return tuple(_drift(k, ohm, time_s) for k, ohm in sorted(drift_ohm.items()))


def _paths(
    seen: tuple[Array, Array],
    run: NDArray[np.intp],
    wandering_of: Callable[[list[int]], list[int]],
    criteria: Criteria,
) -> dict[int, Array]:
    """(R,) shares of each contact that wanders from frame to frame, by what was ``seen`` of each, with errors."""
    moved, error = seen
    surprise = np.sqrt(((moved / error) ** 2).mean(axis=0))
    restless = [k for k in range(moved.shape[1] - 1) if surprise[k] > criteria.clear_errors]
    found = (k for k in wandering_of(restless) if wanders(*_by_run(moved[:, k], error[:, k], run), criteria))
    paths = {k: _smoothed(moved[:, k], error[:, k]) for k in found}
    # Read off the slope at the mean: where that leads to nothing or less, readings hardly show the contact.
    return {k: path for k, path in paths.items() if path.min() > LEAST_LEFT - 1}


def _settled_ohm(
    found: Settling,
    change_v: Array,
    seen: tuple[Array, Array],
    columns: Array,
    ohm: Array,
    noise_v: float,
    scan_of: ScanOf,
    criteria: Criteria,
) -> dict[int, Array]:
    """(R,) ohm of each contact that settles and has no other way about its course, by what was ``seen`` of each, with
    errors: off the slope at the mean where none goes far; else on the sheet solved in full, and none if one that goes
    far has another way, for then the others may only mend its course."""
    moved, error = seen

    def alike(off: Array) -> list[int]:
        return [k for k in found.size if _alike(off[:, k], error[:, k], criteria)]

    off = moved.copy()
    for k, path in found.path.items():
        off[:, k] -= path
    far = [k for k, path in found.path.items() if np.abs(path).max() >= NEAR]
    if not far:
        return {k: ohm[k] * (1 + found.path[k]) for k in alike(off)}
    if any((off[:, k] ** 2).sum() > CURVED * (found.path[k] ** 2).sum() for k in far if k not in alike(off)):
        return {}

    def scaled(contacts: Array) -> tuple[Array, Array]:
        scan, slope = scan_of(contacts)
        return scan / noise_v, slope / noise_v

    relative, change = grown(found, change_v / noise_v, columns[:, -1], ohm, scaled)
    kept = alike(each_moved(change_v - noise_v * change, noise_v, columns, np.zeros((*change.shape, 0)))[0])
    return {k: ohm[k] * relative[k] for k in kept} if set(far) <= set(kept) else {}


def _drift(electrode: int, ohm: Array, time_s: Array) -> Effect:
    """A contact that leaves its resistance by ``ohm`` (R,) at times (R,)."""
    path = {"electrode": electrode, "knot_s": tuple(time_s.tolist()), "ohm": tuple(ohm.tolist())}
    return measured_as(Measured.CONTACT_PATH)().changed(path)


def each_moved(change_v: Array, noise_v: float, columns: Array, traces: Array) -> tuple[Array, Array]:
    """(R,L+1) shares of contacts and sheet, all of them free, in the rest frames' changes (R,P), and their errors."""
    moved, error = np.empty((2, len(change_v), columns.shape[1]))
    for row, trace in enumerate(traces):
        inverse = np.linalg.pinv(np.hstack([columns, trace]))[: columns.shape[1]]
        moved[row], error[row] = inverse @ change_v[row], noise_v * np.sqrt((inverse**2).sum(axis=1))
    return moved, error


def _alike(off: Array, error: Array, criteria: Criteria) -> bool:
    """Whether what two paths differ by, (R,), is not clearly more than their errors: a contact that also jumps from run
    to run has no course."""
    return float((off**2).sum()) <= criteria.clear_errors**2 * float((error**2).sum())


def wandering(
    change: Array, designs: Sequence[Array], taken: Sequence[int], restless: list[int], doubt: float = 0.0
) -> list[int]:
    """Which of the ``restless`` contacts explain the rest frames' changes (R,P), in units of the noise.

    ``designs`` (R of (P,L+1)): each contact's column and, last, the whole sheet's; ``taken`` degrees of freedom gone
    before. All of them where together they leave no more than chance would, few where those leave little; else
    something other than contacts changed, which many of them would share out among themselves, and only those count
    that explain much alone. None where less has changed than the chi-square ``doubt``, which errors of what was taken
    off before may leave.
    """

    def excess(chosen: list[int]) -> float:
        total = 0.0
        for row, design, gone in zip(change, designs, taken, strict=True):
            space = np.linalg.qr(design[:, [*chosen, -1]])[0]
            total += float((row**2).sum() - ((space.T @ row) ** 2).sum()) - (len(row) - gone - space.shape[1])
        return total

    before = excess([])
    if not restless or before <= doubt:
        return []
    alone = {k: before - excess([k]) for k in restless}
    chance = SURELY * np.sqrt(2 * (change.size - sum(taken)))
    if excess(restless) < min(chance, LEFT * before):
        return restless
    order = sorted(restless, key=lambda k: -alone[k])
    for count in range(1, 1 + min(len(order), (designs[0].shape[1] - 1) // FEW_OF)):
        if excess(order[:count]) < LEFT * before:
            return sorted(order[:count])
    return [k for k in restless if alone[k] > ALONE * before]


def _by_run(path: Array, error: Array, run: NDArray[np.intp]) -> tuple[Array, Array]:
    """Means of a path (R,) and their errors, run by run; as they are where there are too few runs."""
    number, of, count = np.unique(run, return_inverse=True, return_counts=True)
    if len(number) < ENOUGH_RESTS:
        return path, error
    mean = np.bincount(of, path) / count
    return mean, np.sqrt(np.bincount(of, error**2)) / count


def wanders(path: Array, error: Array, criteria: Criteria) -> bool:
    """Whether a path (R,) seen with ``error`` (R,) goes from place to place rather than being anywhere every time.

    By J. von Neumann's ratio, Ann. Math. Stat. 12, 367 (1941): half the mean square of the steps over the variance,
    both without the error. White noise has 1, a random walk about 3 / (R + 1): half-way between is the limit, or where
    white noise comes once in fifty if that is less. Frames that hardly tell the contact are left out: next to a place
    not yet recovered its path goes anywhere.
    """
    accurate = error <= HARDLY * np.quantile(error, 0.25)
    path, error, count = path[accurate], error[accurate], int(accurate.sum())
    if count < FEWEST:
        return False
    rarely = 1 - criteria.clear_errors * np.sqrt((count - 2) / (count**2 - 1))
    noise = float((error**2).mean())
    steps = 0.5 * float((np.diff(path) ** 2).mean()) - noise
    return steps < min(0.5 * (1 + 3 / (count + 1)), rarely) * (float(path.var(ddof=1)) - noise)


def _smoothed(path: Array, error: Array) -> Array:
    """A random walk seen through noise, by the Kalman smoother, its step size from the path's own increments."""
    least = 1e-4 * float(np.median(error)) ** 2
    step = max(float(np.mean(np.diff(path) ** 2 - error[1:] ** 2 - error[:-1] ** 2)), least)
    mean, variance = np.zeros(len(path)), np.zeros(len(path))
    m, v = float(path[0]), float(error[0]) ** 2
    for k, seen in enumerate(path):
        if k:
            v += step
            gain = v / (v + error[k] ** 2)
            m, v = m + gain * (seen - m), (1 - gain) * v
        mean[k], variance[k] = m, v
    for k in range(len(path) - 2, -1, -1):
        back = variance[k] / (variance[k] + step)
        mean[k] += back * (mean[k + 1] - mean[k])
    return mean
