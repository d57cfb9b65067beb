"""How many contacts, where, how hard: contacts are added one at a time for as long as the evidence grows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.touch.posterior import APART_M, Fit, covariances, fitted, log_evidence, refined, roughly, stated
from ertskin.physics.touch.table import ResponseTable

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
FIRST_STEPS = 6
"""Contacts near those proposed are almost found in these; others begin again as if the response erred."""
HELD_STEPS = 4
"""Contacts that go on are found in less."""
LIGHTER = 0.05
"""A touch may be this much lighter than the lightest contact before a reading without contacts is a strange one."""
HOPELESS = 10.0
"""One contact more that promises to lower the misfit by less than this is not looked for: a contact known no better
than to 3 mm and 30 % costs 15 of it in the evidence."""
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
            search = self._search(reading)
            search.run(_finite(start))
            found.append(search)
        return self._believed(found)

    def followed(self, reading: Array, proposed: Array, held: Held | None = None) -> tuple[Beliefs, Held | None]:
        """Contacts of one reading (D,), and what to hold of them for the next; ``proposed`` (C,3) as in ``of``.

        Where the contacts ``held`` of the reading before leave of this one what they left of theirs but for noise,
        there is nothing new to be found, and nothing is searched for.
        """
        search = self._search(np.ascontiguousarray(reading, dtype=float))
        offered = _finite(proposed)
        same = held is not None and search.goes_on(held, len(offered))
        if not same:
            search.run(offered)
        beliefs = self._believed([search])
        if search.fit is None:
            return beliefs, None
        logs = search.logs - search.logs[len(search.fit.touch)]
        if same and held is not None:
            return beliefs, replace(held, fit=search.fit, logs=logs)
        return beliefs, Held(search.fit, search.fit.left, search.fit.misfit, len(offered), logs)

    def _search(self, reading: Array) -> Search:
        return Search(reading, self._model, self._scan, self.most, self.exchanges)  # type: ignore[attr-defined]

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
    searched through, when these contacts, moved since, were the most probable and so many ``proposed``; ``logs``
    (C+1,): log evidences less theirs."""

    fit: Fit
    left: Array
    misfit: float
    proposed: int
    logs: Array


class Scan:
    """What a search for one contact more begins from: ``place`` (n,2) by ``force`` (m,) and ``response`` (n*m,D), in
    single precision, and the responses ``light`` (n,D) to the lightest contacts there can be; the sums of their
    squares."""

    def __init__(self, table: ResponseTable, force_n: Array, least_n: float) -> None:
        grid = table.grid
        x, y = (np.linspace(a[0], a[-1], max(2, round((a[-1] - a[0]) / SCAN_M) + 1)) for a in (grid.x_m, grid.y_m))
        self.place, self.force = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), force_n
        response = table.alone(np.repeat(self.place, len(force_n), axis=0), np.tile(force_n, len(self.place)))
        self.light = np.ascontiguousarray(table.alone(self.place, np.full(len(self.place), least_n)))
        self.response = response.astype(np.float32)
        self.squares = (response**2).sum(axis=1).reshape(len(self.place), -1)
        self.light_squares = (self.light**2).sum(axis=1)

    def nearest(self, left: Array, now: Array) -> Iterator[Array]:
        """(3,) of the scan, apart from one another: the contacts that beside those ``now`` (n,3) leave least of what
        they leave (D,), best first."""
        remains = self.squares - 2.0 * (self.response @ left.astype(np.float32)).reshape(self.squares.shape)
        least = remains.min(axis=1)
        for contact in now:
            least[self._near(contact, APART_M)] = np.inf
        while True:
            best = int(np.argmin(least))
            yield np.append(self.place[best], self.force[np.argmin(remains[best])])
            least[self._near(self.place[best], STARTS_APART_M)] = np.inf

    def _near(self, contact: Array, least_m: float) -> NDArray[np.bool_]:
        away = self.place - contact[:2]
        return np.asarray((away * away).sum(axis=1) < least_m**2)


class Search:
    """The most probable contacts of one reading (D,): their ``fit``, None for none, covariances (n,3,3) by x, y and log
    force, the log evidence ``logs`` (C+1,) of each number of contacts, and the mean misfit ``square``."""

    def __init__(self, reading: Array, model: tuple[Any, ...], scan: Scan, most: int, exchanges: int) -> None:
        self.reading, self.model, self.scan, self.exchanges = reading, model, scan, exchanges
        self.low, self.high = model[4:]
        self.enough = SATISFIED * len(reading)
        self.fit: Fit | None = None
        self.logs = np.full(most + 1, -np.inf)
        whole = float(reading @ reading)
        self.logs[0], self.square = -0.5 * whole, whole / len(reading)

    def goes_on(self, held: Held, proposed: int) -> bool:
        """Whether the contacts held explain this reading as they did the one they were found in, and where that is
        poorly, as many are ``proposed`` still; they are the answer then, or one less."""
        fit = fitted(self.reading, held.fit.touch, self.model, held.fit, steps=HELD_STEPS)
        changed = fit.left - held.left
        if not changed @ changed <= 2.0 * self.enough or not self._possible(fit.touch):
            return False
        if fit.misfit > self.enough and (held.misfit <= self.enough or proposed != held.proposed):
            return False
        more = len(fit.touch) + 1
        self._weighed(fit)
        if self.fit is None:
            self.logs[1:] = -np.inf
            return False
        self.logs[more:] = held.logs[more:] + self.logs[more - 1]
        while self._one_less():
            pass
        return True

    def run(self, proposed: Array) -> None:
        """Contacts are added one at a time to the ``proposed`` (n,3), then perhaps left out."""
        if not np.isfinite(self.square):
            return
        fit, near = self._begun(proposed)
        if near is not None:
            more = self._extended(near, STARTS)
            # Where that explains too little something else is wrong, and those proposed are to be weighed first.
            explained = more.misfit <= self.enough and self._possible(more.touch)
            fit = more if explained else self._begun(proposed, surely=False)[0]
        while True:
            if fit is not None:
                poor = fit.misfit > self.enough or not self._possible(fit.touch)
                if len(fit.touch) > 1 and poor and self.square >= SATISFIED:
                    fit = self._exchanged(fit)
                if not self._possible(fit.touch) or not self._weighed(fit):
                    break
            count = 0 if fit is None else len(fit.touch)
            if count == len(self.logs) - 1 or self.square < SATISFIED or not (fit is None or self._hopeful(fit)):
                break
            fit = self._extended(fit, STARTS)
        while self._one_less():
            pass
        if self.fit is None and self.square >= SATISFIED:
            self._lightest()

    def _begun(self, proposed: Array, surely: bool = True) -> tuple[Fit | None, Fit | None]:
        """The proposed contacts fitted together, the weakest left out for as long as they can't all be; and, where one
        more is there ``surely`` by the smoothed misfit, as they are to be fitted with it."""
        now = proposed
        while len(now):
            fit = fitted(self.reading, now, self.model, steps=FIRST_STEPS)
            if fit.misfit <= self.enough and not fit.settled:
                fit = fitted(self.reading, fit.touch, self.model, fit)
            if fit.misfit > self.enough:
                near = roughly(self.reading, now, self.model)
                lacking = near.misfit > LACKING * len(self.reading) and len(now) < len(self.logs) - 1
                if surely and lacking and self._possible(fit.touch) and self._possible(near.touch):
                    return fit, near
                fit = fitted(self.reading, near.touch, self.model)
            if self._possible(fit.touch):
                return fit, None
            now = np.delete(fit.touch, np.argmin(fit.touch[:, 2]), axis=0)
        return None, None

    def _weighed(self, fit: Fit) -> bool:
        """Take in a number of contacts, and keep them if none is more probable; whether to go on with more."""
        best, count = self.logs.max(), len(fit.touch)
        self.logs[count] = log_evidence(fit, self.low, self.high)
        if self.logs[count] > best:
            self._keep(fit)
        return bool(self.logs[count] >= best - SLACK)

    def _keep(self, fit: Fit) -> None:
        self.fit, self.covariance, self.square = fit, covariances(fit), fit.misfit / len(self.reading)

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
        place = next(self.scan.nearest(self.reading, np.empty((0, 3))))
        place[2] = low[2]
        fit = fitted(self.reading, place[None], (spline, cells, spread, remainder, lighter, high))
        self.square = min(self.square, fit.misfit / len(self.reading))

    def _hopeful(self, fit: Fit) -> bool:
        """Whether one contact more, as light as they can be or stronger, may lower the misfit by as much as its place
        and force cost in the evidence, those there are following as straight as they look."""
        rows = fit.rows[:-1]
        products = rows @ rows.T
        diagonal = products.diagonal().copy()
        half = len(rows) // 2
        diagonal[:half] = fit.variance
        diagonal[half:] = 1e-9 * diagonal[half:] + 1e-12
        products[range(2 * half), range(2 * half)] += diagonal
        across = np.linalg.solve(np.linalg.cholesky(products), rows)
        free = fit.left - (across @ fit.left) @ across
        # Where much is left, any place tells it: few of them first.
        for light, squares in (
            (self.scan.light[::FEW], self.scan.light_squares[::FEW]),
            (self.scan.light, self.scan.light_squares),
        ):
            own = (squares - np.square(light @ across.T).sum(axis=1)) / fit.variance
            by_left = light @ free / fit.variance
            share = np.maximum(by_left / own, 1.0)
            if np.any(share * (2.0 * by_left - share * own) > HOPELESS):
                return True
        return False

    def _extended(self, fit: Fit | None, starts: int) -> Fit:
        """``refined`` of the contacts of a fit with the one more that fits best, of so many ``starts``."""
        now, left = (np.empty((0, 3)), self.reading) if fit is None else (fit.touch, fit.left)
        best: Fit | None = None
        for contact in islice(self.scan.nearest(left, now), starts):
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
