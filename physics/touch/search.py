"""How many contacts, where, how hard: contacts are added one at a time for as long as the evidence grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.physics.touch.posterior import APART_M, Fit, covariances, fitted, log_evidence, refined, roughly, stated
from ertskin.physics.touch.table import ResponseTable, dot

Array = NDArray[np.float64]

STARTS, STARTS_APART_M = 3, 12e-3
"""Places a search for one contact more begins from."""
SATISFIED = 1.5
"""Mean square in units of the noise: contacts that leave less need no other, those that leave more are looked for again
one by one."""
LACKING = 0.5
"""Contacts that leave more, even if the response erred by a tenth, lack one: 123 of 134 frames that did left more, and
21 that only began in a wrong place 0.11 at most."""
EXCHANGES = 3
FEW = 16
"""Every sixteenth place tells first whether another contact is hopeful."""
IMPOSSIBLE = 1e12
SCAN_M = 6e-3
SCAN_FORCES = (0.06, 0.12, 0.25, 0.5, 0.8)
"""Shares of the largest force that a search begins from."""
BEYOND_DOUBT = 200.0
"""A contact whose force is this many times its standard deviation, squared, costs so much in the log evidence to leave
out that fewer contacts are out of question."""
HELD_STEPS = 4
"""Contacts that go on are found in less."""
LIGHTER = 0.05
"""A touch may be this much lighter than the lightest contact before a reading without contacts is a strange one."""
HOPELESS = 10.0
"""One contact more that promises to lower the misfit by less than this is not looked for: a contact known no better
than to 3 mm and 30 % costs 15 of it in the evidence."""
NEARBY = 1e-3
"""Share of a contact's response that is taken for its own at least, in single precision."""
SLACK = 8.0
"""One contact more is still tried where the last one lost less than this much of the log evidence: two that are close
may only together be better than one."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """N readings' contacts, the most probable number of them; C slots, NaN where there is none.

    ``contact_m`` (N,C,2), ``force_n`` (N,C). ``covariance`` (N,C,3,3): of x, y (metre) and force (newton) of each.
    ``probability`` (N,C): that each is there. ``count_probability`` (N,C+1): of each number of contacts.
    ``misfit`` (N,): mean square of what is left, in units of the noise; about 1 where the skin is as it was calibrated.
    """

    contact_m: Array
    force_n: Array
    covariance: Array
    probability: Array
    count_probability: Array
    misfit: Array


@dataclass(frozen=True, eq=False)
class TouchPosterior:
    """Contacts from readings in the coordinates of ``table``, which are in units of the noise.

    ``spread`` (3,) and ``remainder``: what the response may err by (``ertskin.physics.touch.posterior``).
    ``error`` (3,): further standard deviations of x, y (metre) and, as a share of the response, along its slope by
    force: where a press hardly changes it any more, that is much force. ``temperature``: by
    how much the log evidence is too sure. ``most``: contacts looked for at most. ``exchanges``: rounds in which
    contacts that fit poorly are looked for anew; each may take a tenth of a second. ``widening``: of every covariance.
    """

    table: ResponseTable
    spread: Array
    remainder: float
    error: Array
    least_force_n: float
    temperature: float = 1.0
    most: int = 4
    exchanges: int = EXCHANGES
    widening: float = 1.0

    def __post_init__(self) -> None:
        table, (low, high) = self.table, self.bounds
        spline = table.knots_x, table.knots_y, table.knots_n, table.response
        spread = np.ascontiguousarray(self.spread, dtype=float)
        model = spline, table.compiled(), spread, float(self.remainder), low, high
        object.__setattr__(self, "_error", np.ascontiguousarray(self.error, dtype=float))
        object.__setattr__(self, "_model", model)
        forces_n = np.array(SCAN_FORCES) * table.grid.force_n[-1]
        object.__setattr__(self, "_scan", Scan(table, forces_n, self.least_force_n))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(3,) least and (3,) largest x, y and force looked for."""
        grid = self.table.grid
        low = np.array([grid.x_m[0], grid.y_m[0], self.least_force_n], dtype=float)
        return low, np.array([grid.x_m[-1], grid.y_m[-1], grid.force_n[-1]], dtype=float)

    def of(self, readings: Array, proposed: Array | None = None) -> Beliefs:
        """Contacts of (N,D) readings; ``proposed`` (N,C,3) contacts to begin from, NaN for none, most likely first."""
        starts = np.full((len(readings), 0, 3), np.nan) if proposed is None else proposed
        found = []
        for reading, start in zip(np.ascontiguousarray(readings, dtype=float), starts, strict=True):
            search = self._search(reading, partial(_finite, start))
            search.run()
            found.append(search)
        return self._believed(found)

    def followed(
        self, reading: Array, propose: Callable[[], Array], held: Held | None = None
    ) -> tuple[Beliefs, Held | None]:
        """Contacts of one reading (D,), and what to hold of them for the next; ``propose`` gives contacts (C,3) as in
        ``of``, and is asked only where it matters.

        Where the contacts ``held`` of the reading before leave of this one what they left of theirs but for noise,
        there is nothing new to be found, and nothing is searched for; where they have come to fit poorly by that,
        one more is looked for from where they are.
        """
        search = self._search(np.ascontiguousarray(reading, dtype=float), lambda: _finite(propose()))
        moved = None if held is None else search.moved(held)
        before = None
        if held is not None and moved is not None and (moved.misfit <= search.enough or held.misfit > search.enough):
            before = held
            search.goes_on(moved, before)
        else:
            search.run(moved)
        beliefs = self._believed([search])
        if search.fit is None:
            return beliefs, None
        logs = search.logs - search.logs[len(search.fit.touch)]
        if before is not None:
            return beliefs, replace(before, fit=search.fit, logs=logs)
        return beliefs, Held(search.fit, search.fit.left, search.fit.misfit, search.asked, logs)

    def _search(self, reading: Array, propose: Callable[[], Array]) -> Search:
        return Search(reading, propose, self._model, self._scan, self.most, self.exchanges)  # type: ignore[attr-defined]

    def _believed(self, found: list[Search]) -> Beliefs:
        shape = len(found), self.most
        touch, covariance = np.full((*shape, 3), np.nan), np.full((*shape, 3, 3), np.nan)
        logs, misfit = np.empty((shape[0], self.most + 1)), np.empty(shape[0])
        for n, search in enumerate(found):
            logs[n], misfit[n] = search.logs, search.square
            if search.fit is not None:
                count = len(search.fit.touch)
                touch[n, :count], covariance[n, :count] = search.fit.touch, search.covariance
                stated(touch[n, :count], self._model[0], self._error, self.widening, covariance[n, :count])  # type: ignore[attr-defined]
        share = np.exp((logs - logs.max(axis=1, keepdims=True)) / self.temperature)
        share /= share.sum(axis=1, keepdims=True)
        there = np.cumsum(share[:, ::-1], axis=1)[:, ::-1][:, 1:]
        probability = np.where(np.isfinite(touch[..., 2]), there, np.nan)
        return Beliefs(touch[..., :2], touch[..., 2], covariance, probability, share, misfit)


def _finite(contacts: Array) -> Array:
    """Those of (C,3) that there are."""
    return np.ascontiguousarray(contacts[np.isfinite(contacts[:, 0])], dtype=float)


@dataclass(frozen=True, eq=False, slots=True)
class Held:
    """Contacts of a reading, kept for the next: their ``fit``; ``left`` (D,) and ``misfit`` of the reading last
    searched through, when these contacts, moved since, were the most probable and so many ``proposed``, nought if none
    were asked for; ``logs`` (C+1,): log evidences less theirs."""

    fit: Fit
    left: Array
    misfit: float
    proposed: int
    logs: Array


class Scan:
    """What a search for one contact more begins from: ``place`` (n,2) by ``force`` (m,) and ``response`` (n,m,D), in
    single precision, and the responses ``light`` (n,D) to the lightest contacts there can be; the sums of their
    squares, and an ``order`` (n,) of the places."""

    def __init__(self, table: ResponseTable, force_n: Array, least_n: float) -> None:
        grid = table.grid
        x, y = (np.linspace(a[0], a[-1], max(2, round((a[-1] - a[0]) / SCAN_M) + 1)) for a in (grid.x_m, grid.y_m))
        self.place, self.force = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), force_n
        response = table.alone(np.repeat(self.place, len(force_n), axis=0), np.tile(force_n, len(self.place)))
        self.light = np.ascontiguousarray(table.alone(self.place, np.full(len(self.place), least_n)))
        self.response = response.astype(np.float32).reshape(len(self.place), len(force_n), -1)
        self.squares = (response**2).sum(axis=1).reshape(len(self.place), -1)
        self.light_squares = (self.light**2).sum(axis=1)
        # Few places first, all over the sheet: where much is left, any of them tells it.
        self.order = np.concatenate([np.arange(k, len(self.place), FEW) for k in range(FEW)])
        self.light = self.light.astype(np.float32)

    def nearest(self, left: Array, now: Array, starts: int) -> Array:
        """(n,3) of the scan, ``starts`` of them at most, apart from one another: the contacts that beside those ``now``
        (C,3) leave least of what they leave (D,), best first."""
        table = self.place, self.force, self.response, self.squares
        return np.asarray(_nearest(left.astype(np.float32), now, *table, starts))

    def hopeful(self, fit: Fit) -> bool:
        """Whether one contact more, as light as they can be or stronger, may lower the misfit by as much as its place
        and force cost in the evidence, those there are following as straight as they look."""
        across = _across(fit.rows, fit.variance).astype(np.float32)
        return bool(_promises(across, fit.variance, self.light, self.light_squares, self.order))


class Search:
    """The most probable contacts of one reading (D,): their ``fit``, None for none, covariances (n,3,3) by x, y and log
    force, the log evidence ``logs`` (C+1,) of each number of contacts, and the mean misfit ``square``."""

    def __init__(
        self,
        reading: Array,
        propose: Callable[[], Array],
        model: tuple[Any, ...],
        scan: Scan,
        most: int,
        exchanges: int,
    ) -> None:
        self.reading, self.model, self.scan, self.exchanges = reading, model, scan, exchanges
        self._propose = propose
        self._proposed: Array | None = None
        self.asked = 0
        self.low, self.high = model[4:]
        self.enough = SATISFIED * len(reading)
        self.fit: Fit | None = None
        self.logs = np.full(most + 1, -np.inf)
        whole = float(reading @ reading)
        self.logs[0], self.square = -0.5 * whole, whole / len(reading)

    def proposed(self) -> Array:
        """(n,3) contacts to begin from, asked for once; ``asked`` is their number then."""
        if self._proposed is None:
            self._proposed = self._propose()
            self.asked = len(self._proposed)
        return self._proposed

    def moved(self, held: Held) -> Fit | None:
        """The contacts held, if they leave of this reading what they left of the one they were found in, but for noise,
        and where that is much still, no more are proposed than there are, or were when they were found."""
        fit = fitted(self.reading, held.fit.touch, self.model, held.fit, steps=HELD_STEPS)
        changed = fit.left - held.left
        if not changed @ changed <= 2.0 * self.enough or not self._possible(fit.touch):
            return None
        if min(fit.misfit, held.misfit) > self.enough and len(self.proposed()) > max(held.proposed, len(fit.touch)):
            return None
        self._weighed(fit)
        if self.fit is None:
            self.logs[1:] = -np.inf
            return None
        return fit

    def goes_on(self, fit: Fit, held: Held) -> None:
        """The contacts held, moved to ``fit``, are the answer, or one less."""
        more = len(fit.touch) + 1
        self.logs[more:] = held.logs[more:] + self.logs[more - 1]
        self._fewer()

    def run(self, fit: Fit | None = None) -> None:
        """Contacts are added one at a time to those of ``fit``, or of the proposed ones where there are more, then
        perhaps left out."""
        if not np.isfinite(self.square):
            return
        begun = fit is None
        fit = self._begun(self.proposed()) if fit is None else fit
        while True:
            if fit is not None:
                poor = fit.misfit > self.enough or not self._possible(fit.touch)
                if len(fit.touch) > 1 and poor and self.square >= SATISFIED:
                    fit = self._exchanged(fit)
                if not self._possible(fit.touch) or not self._weighed(fit):
                    break
            if not self._hopeful(fit):
                break
            more = not begun and fit is not None and len(self.proposed()) > len(fit.touch)
            fit, begun = self._begun(self.proposed()) if more else self._extended(fit, STARTS), True
        self._fewer()
        if self.fit is None and self.square >= SATISFIED:
            self._lightest()

    def _begun(self, proposed: Array) -> Fit | None:
        """The proposed contacts fitted together, the weakest left out for as long as they can't all be; with one more
        where by the smoothed misfit one is lacking."""
        now, hopeful = proposed, True
        while len(now):
            near = roughly(self.reading, now, self.model)
            lacking = hopeful and self._lacks_one(near)
            # What is much even if the response erred is more if it doesn't.
            fit = None if lacking and near.misfit > self.enough else fitted(self.reading, near.touch, self.model)
            if lacking and (fit is None or fit.misfit > self.enough):
                more = self._extended(near, STARTS)
                if more.misfit <= self.enough and self._possible(more.touch):
                    return more
                # Something else is wrong, and those proposed are to be weighed first.
                hopeful = False
            fit = fitted(self.reading, near.touch, self.model) if fit is None else fit
            if self._possible(fit.touch):
                return fit
            now = np.delete(fit.touch, np.argmin(fit.touch[:, 2]), axis=0)
        return None

    def _lacks_one(self, near: Fit) -> bool:
        """Whether contacts fitted as if the response erred leave so much that one more is there."""
        much = near.misfit > LACKING * len(self.reading) and len(near.touch) < len(self.logs) - 1
        return much and self._possible(near.touch)

    def _weighed(self, fit: Fit) -> bool:
        """Take in a number of contacts, and keep them if none is more probable; whether to go on with more."""
        best, count = self.logs.max(), len(fit.touch)
        self.logs[count] = log_evidence(fit, self.low, self.high)
        if self.logs[count] > best:
            self._keep(fit)
        return bool(self.logs[count] >= best - SLACK)

    def _keep(self, fit: Fit) -> None:
        self.fit, self.covariance, self.square = fit, covariances(fit), fit.misfit / len(self.reading)

    def _fewer(self) -> None:
        """Contacts are left out for as long as that is more probable."""
        while self._one_less():
            pass

    def _one_less(self) -> bool:
        """Weigh one contact less than the best, the one least sure left out, unless that is out of question; whether
        that is best then."""
        count = 0 if self.fit is None else len(self.fit.touch)
        if self.fit is None or count < 2 or np.isfinite(self.logs[count - 1]):
            return False
        doubtful = int(np.argmax(self.covariance[:, 2, 2]))
        if self.covariance[doubtful, 2, 2] < 1.0 / BEYOND_DOUBT:
            return False
        fit = fitted(self.reading, np.delete(self.fit.touch, doubtful, axis=0), self.model)
        if not self._possible(fit.touch):
            return False
        self.logs[count - 1] = log_evidence(fit, self.low, self.high)
        if self.logs[count - 1] < self.logs[count]:
            return False
        self._keep(fit)
        return True

    def _lightest(self) -> None:
        """A reading without contacts may have one that is lighter than they can be."""
        spline, cells, spread, remainder, low, high = self.model
        lighter = low * [1.0, 1.0, LIGHTER]
        place = self.scan.nearest(self.reading, np.empty((0, 3)), 1)[0]
        place[2] = low[2]
        fit = fitted(self.reading, place[None], (spline, cells, spread, remainder, lighter, high))
        self.square = min(self.square, fit.misfit / len(self.reading))

    def _hopeful(self, fit: Fit | None) -> bool:
        """Whether there may be a contact more than those of ``fit``."""
        if (0 if fit is None else len(fit.touch)) == len(self.logs) - 1 or self.square < SATISFIED:
            return False
        return fit is None or self.scan.hopeful(fit)

    def _extended(self, fit: Fit | None, starts: int) -> Fit:
        """``refined`` of the contacts of a fit with the one more that fits best, of so many ``starts``."""
        now, left = (np.empty((0, 3)), self.reading) if fit is None else (fit.touch, fit.left)
        best: Fit | None = None
        for contact in self.scan.nearest(left, now, starts):
            other = refined(self.reading, np.vstack([now, contact]), self.model)
            if best is None or self._cost(other) < self._cost(best):
                best = other
            if best.misfit < self.enough and self._possible(best.touch):
                break
        assert best is not None
        return best

    def _exchanged(self, fit: Fit) -> Fit:
        """Each contact in turn taken away and looked for anew, for as long as that fits better."""
        best = fit
        for _ in range(self.exchanges):
            better = False
            for c in range(len(fit.touch)):
                alone = refined(self.reading, np.delete(best.touch, c, axis=0), self.model)
                other = self._extended(alone, 2 * STARTS)
                if self._cost(other) < self._cost(best) - 1.0:
                    best, better = other, True
                    if best.misfit < self.enough and self._possible(best.touch):
                        return best
            if not better:
                break
        return best

    def _cost(self, fit: Fit) -> float:
        """What ``refined`` minimises, far above anything possible for contacts that can't be."""
        return fit.misfit + (fit.logarithm if self._possible(fit.touch) else IMPOSSIBLE)

    def _possible(self, touch: Array) -> bool:
        """Whether all of the contacts (C,3) press, and none lies nearer to another than contacts can."""
        places = touch.tolist()
        return all(force_n > self.low[2] for _, _, force_n in places) and all(
            (x - u) ** 2 + (y - v) ** 2 >= APART_M**2 for (x, y, _), (u, v, _) in combinations(places, 2)
        )


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _single_dot(one, other):  # type: ignore[no-untyped-def]
    """``dot`` of numbers in single precision, summed in that."""
    total = np.float32(0.0)
    for d in range(len(one)):
        total += one[d] * other[d]
    return total


@njit(cache=True, nogil=True)
def _nearest(left, now, place, force, response, squares, starts):  # type: ignore[no-untyped-def]
    """(n,3) of ``Scan.nearest``."""
    count, best = len(place), np.empty(len(place), dtype=np.int64)
    least, found = np.full(count, np.inf), np.empty((starts, 3))
    for p in range(count):
        for f in range(len(force)):
            remains = squares[p, f] - 2.0 * _single_dot(response[p, f], left)
            if remains < least[p]:
                least[p], best[p] = remains, f
        for c in range(len(now)):
            if (place[p, 0] - now[c, 0]) ** 2 + (place[p, 1] - now[c, 1]) ** 2 < APART_M**2:
                least[p] = np.inf
    for n in range(starts):
        first = np.argmin(least)
        if not np.isfinite(least[first]):
            return found[:n]
        found[n, 0], found[n, 1], found[n, 2] = place[first, 0], place[first, 1], force[best[first]]
        for p in range(count):
            if (place[p, 0] - place[first, 0]) ** 2 + (place[p, 1] - place[first, 1]) ** 2 < STARTS_APART_M**2:
                least[p] = np.inf
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _across(rows, variance):  # type: ignore[no-untyped-def]
    """(2n+1,D) orthonormal directions that contacts and errors of a fit with these ``rows`` can follow, its errors with
    a part of what they are allowed by the noise's ``variance`` (Cholesky), and what is left then."""
    count, free = len(rows), rows.copy()
    products = np.empty((count, count))
    for i in range(count):
        for j in range(i):
            products[i, j] = dot(rows[i], rows[j])
    for i in range(count - 1):
        square = dot(rows[i], rows[i])
        square += variance if i < count // 2 else 1e-9 * square + 1e-12
        for k in range(i):
            share = products[i, k]
            for j in range(k):
                share -= products[i, j] * products[k, j]
            share /= products[k, k]
            products[i, k] = share
            square -= share * share
            for d in range(rows.shape[1]):
                free[i, d] -= share * free[k, d]
        products[i, i] = np.sqrt(square)
        for d in range(rows.shape[1]):
            free[i, d] /= products[i, i]
    for k in range(count - 1):
        share = dot(free[k], rows[count - 1])
        for d in range(rows.shape[1]):
            free[count - 1, d] -= share * free[k, d]
    return free


@njit(cache=True, nogil=True)
def _promises(across, variance, light, squares, order):  # type: ignore[no-untyped-def]
    """Whether one of the ``light`` contacts (n,D), or a stronger one in its place, promises to lower the misfit by
    ``HOPELESS``, given ``_across`` of the contacts there are."""
    last = len(across) - 1
    for p in order:
        own = squares[p]
        for k in range(last):
            own -= _single_dot(across[k], light[p]) ** 2
        own = max(own, NEARBY * squares[p]) / variance
        by_left = _single_dot(light[p], across[last]) / variance
        share = max(by_left / own, 1.0)
        if share * (2.0 * by_left - share * own) > HOPELESS:
            return True
    return False
