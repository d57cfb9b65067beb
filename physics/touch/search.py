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
from ertskin.physics.touch.starts import SCAN_FORCES, Starts
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]

STARTS = 3
"""Places a search for one contact more begins from."""
SATISFIED = 1.5
"""Mean square in units of the noise: contacts that leave less need no other, those that leave more are looked for again
one by one."""
LACKING = 0.5
"""Contacts that leave more, even if the response erred by a tenth, lack one: 123 of 134 frames that did left more, and
21 that only began in a wrong place 0.11 at most."""
SURELY = 10.0
"""What they leave, in units of the noise, is so many times what satisfies: no fit will explain it."""
EXCHANGES = 3
IMPOSSIBLE = 1e12
BEYOND_DOUBT = 200.0
"""A contact whose force is this many times its standard deviation, squared, costs so much in the log evidence to leave
out that fewer contacts are out of question."""
HELD_STEPS = 4
"""Contacts that go on are found in less."""
LIGHTER = 0.05
"""A touch may be this much lighter than the lightest contact before a reading without contacts is a strange one."""
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
    ``error`` (3,) or (4,): further standard deviations of x, y (metre) and, as a share of the response, along its slope
    by force: where a press hardly changes it any more, that is much force; the fourth, nought if not given, is a share
    of the force itself. ``temperature``: by
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
        error = np.zeros(4)
        error[: len(self.error)] = self.error
        object.__setattr__(self, "_error", error)
        object.__setattr__(self, "_model", model)
        forces_n = np.array(SCAN_FORCES) * table.grid.force_n[-1]
        object.__setattr__(self, "_scan", Starts(table, forces_n, self.least_force_n))

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
        share, probability = _shares(logs, self.temperature, touch[..., 2])
        return Beliefs(touch[..., :2], touch[..., 2], covariance, probability, share, misfit)


@njit(cache=True, nogil=True)
def _shares(logs, temperature, force_n):  # type: ignore[no-untyped-def]
    """(N,C+1) probability of each number of contacts by log evidences (N,C+1), and (N,C) that each is there."""
    share, probability = np.empty_like(logs), np.full(force_n.shape, np.nan)
    for n in range(len(logs)):
        share[n] = np.exp((logs[n] - np.max(logs[n])) / temperature)
        share[n] /= np.sum(share[n])
        more = 0.0
        for c in range(force_n.shape[1] - 1, -1, -1):
            more += share[n, c + 1]
            if np.isfinite(force_n[n, c]):
                probability[n, c] = more
    return share, probability


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


class Search:
    """The most probable contacts of one reading (D,): their ``fit``, None for none, covariances (n,3,3) by x, y and log
    force, the log evidence ``logs`` (C+1,) of each number of contacts, and the mean misfit ``square``."""

    def __init__(
        self,
        reading: Array,
        propose: Callable[[], Array],
        model: tuple[Any, ...],
        scan: Starts,
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
            # As if the response erred it counts for less by as much.
            surely = lacking and near.misfit * near.variance > SURELY * self.enough
            fit = None if surely else fitted(self.reading, near.touch, self.model)
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
        that is best then.

        Contacts that leave too much may have been reached by way of fewer that were in a wrong valley: a contact begun
        far too light, say, gave way to a corner and left a ghost there. Those are weighed again.
        """
        count = 0 if self.fit is None else len(self.fit.touch)
        poor = self.square >= SATISFIED
        if self.fit is None or count < 2 or (np.isfinite(self.logs[count - 1]) and not poor):
            return False
        doubtful = int(np.argmax(self.covariance[:, 2, 2]))
        if self.covariance[doubtful, 2, 2] < 1.0 / BEYOND_DOUBT and not poor:
            return False
        fit = fitted(self.reading, np.delete(self.fit.touch, doubtful, axis=0), self.model)
        if not self._possible(fit.touch):
            return False
        log = log_evidence(fit, self.low, self.high)
        self.logs[count - 1] = max(log, self.logs[count - 1])
        if log < self.logs[count]:
            return False
        self._keep(fit)
        return True

    def _lightest(self) -> None:
        """A reading without contacts may have one that is lighter than they can be."""
        spline, cells, spread, remainder, low, high = self.model
        lighter = low * [1.0, 1.0, LIGHTER]
        place = self.scan.with_one_more(self.reading, np.empty((0, 3)), 1)[0][0]
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
        for start in self.scan.with_one_more(left, now, starts):
            other = refined(self.reading, start, self.model)
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
