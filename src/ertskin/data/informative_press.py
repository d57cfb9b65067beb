"""The press that would tell most about a skin, and how accurate the skin is by now.

What the skin does beyond the simulator is six slowly varying numbers (``local_discrepancy``). How well a Gaussian
process knows them at a place depends on where was pressed, not on what came of it (Rasmussen & Williams 2006, 2.2);
what their errors do to place and force of a contact is given by the calibrated response. So the error at every place of
the sheet can be stated before a press is made, and the press chosen that lowers its mean most: integrated variance, one
press at a time (Sacks et al., Statistical Science 4 (1989) 409). How far and how strongly the numbers vary is not known
while presses are few: every length and variance counts by how likely the presses so far make it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.data.local_discrepancy import (
    EXPECTED,
    MODES,
    Apart,
    Process,
    coefficients,
    evidences,
    frame_scatter,
    modes,
    slopes,
)
from ertskin.physics.touch.posterior import SHAPE_M
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]

CELL_M = 0.015
"""The sheet is judged in the middle of cells no larger than this."""
FORCE_SHARES = (0.2, 0.5, 1.0)
"""Shares of the largest force at which it is judged."""
DECADES = 1.0
"""Powers of ten, one standard deviation, to which a process's variance is known beforehand: ``EXPECTED`` squared."""
UNLIKELY = 1e-2
"""Lengths and variances that are less likely than this share of the likeliest are left out."""


@dataclass(frozen=True)
class Accuracy:
    """Rms errors over sheet and forces that one contact is expected to be found with."""

    force_n: float
    location_m: float

    def __str__(self) -> str:
        return f"{self.force_n:.2g} N and {1e3 * self.location_m:.2g} mm"

    def within(self, wanted: Accuracy) -> bool:
        """Whether both errors are as small as those ``wanted``."""
        return self.force_n <= wanted.force_n and self.location_m <= wanted.location_m

    def cost(self, wanted: Accuracy) -> float:
        """Mean square error, each in units of what is ``wanted``."""
        return (self.force_n / wanted.force_n) ** 2 + (self.location_m / wanted.location_m) ** 2


class PressDesign:
    """What presses at (N,2) with (N,) newton leave unknown, and what one press more would."""

    def __init__(
        self,
        table: ResponseTable,
        contact_m: Array,
        force_n: Array,
        press: NDArray[np.int64],
        seen: Array,
        largest_n: float,
    ) -> None:
        """``press`` (N,): which press a frame is of; ``seen`` (N,D): what they showed in the table's coordinates, in
        units of the noise; ``largest_n``: the force up to which the sheet is judged."""
        self.table, self.contact_m, self.force_n = table, contact_m, force_n
        self.same = press[:, None] == press
        basis = modes(table, contact_m, force_n)
        numbers, noise = coefficients(basis, seen - table.alone(contact_m, force_n))
        self.within_press = frame_scatter(force_n, press, numbers, noise)
        self.noise = noise + self.within_press
        self.processes = [
            likely(evidences(contact_m, force_n, press, numbers[:, m], self.noise[:, m])) for m in range(len(MODES))
        ]
        self.judged_m, self.judged_n = judged(table, largest_n)
        self._response = _Response.of(table, self.judged_m, self.judged_n)

    def accuracy(self) -> Accuracy:
        """As of now."""
        none = np.zeros((0, 2)), np.zeros((0, 0)), np.zeros((0, 0, len(MODES)))
        return self._accuracy(self._variances(*none)[0])

    def accuracies(self, place_m: Array, force_n: Array) -> list[Accuracy]:
        """After one press more, for each of the places (C,2), pressed with the forces (F,)."""
        forces = np.tile(force_n, (len(place_m), 1))
        basis = modes(self.table, np.repeat(place_m, len(force_n), axis=0), forces.ravel())
        _, noise = coefficients(basis, np.zeros((len(basis), basis.shape[2])))
        known = (noise + self.within_press).reshape(*forces.shape, len(MODES))
        return [self._accuracy(variance) for variance in self._variances(place_m, forces, known)[1:]]

    def _accuracy(self, variance: Array) -> Accuracy:
        log_force, place_m2 = self._response.errors(variance)
        return Accuracy(float(np.sqrt(np.mean(log_force * self.judged_n**2))), float(np.sqrt(np.mean(place_m2))))

    def _variances(self, place_m: Array, force_n: Array, noise: Array) -> Array:
        """(1+C,J,6) of the numbers where the sheet is judged: as of now, then after each candidate (C,2), (C,F)."""
        total = np.zeros((1 + len(place_m), len(self.judged_n), len(MODES)))
        for m, process in enumerate(self.processes):
            for share, one in process:
                total[..., m] += share * self._reduced(one, self.noise[:, m], place_m, force_n, noise[..., m])
        return total

    def _reduced(self, process: Process, noise: Array, place_m: Array, force_n: Array, new_noise: Array) -> Array:
        """(1+C,J) variances of one number under one of its processes."""

        def between(a_m: Array, a_n: Array, b_m: Array, b_n: Array) -> Array:
            return Apart.of(a_m, a_n, b_m, b_n).covariance(process.length_m, process.variance)

        new_m, new_n = np.repeat(place_m, force_n.shape[1], axis=0), force_n.ravel()
        own = self.contact_m, self.force_n
        inverse = np.linalg.inv(between(*own, *own) + process.scatter * self.same + np.diag(noise))
        to_judged, to_new = between(*own, self.judged_m, self.judged_n), between(*own, new_m, new_n)
        known = inverse @ to_new
        now = process.variance - np.einsum("nj,nj->j", to_judged, inverse @ to_judged)
        across = (between(self.judged_m, self.judged_n, new_m, new_n) - to_judged.T @ known).reshape(
            len(now), *force_n.shape
        )
        rows = [now]
        for c, (place, force) in enumerate(zip(place_m, force_n, strict=True)):
            some = slice(c * len(force), (c + 1) * len(force))
            places = np.tile(place, (len(force), 1))
            within = between(places, force, places, force) + process.scatter - to_new[:, some].T @ known[:, some]
            weights = np.linalg.solve(within + np.diag(new_noise[c]), across[:, c].T)
            rows.append(now - np.einsum("jf,fj->j", across[:, c], weights))
        return np.maximum(np.stack(rows), 0.0)


@dataclass(frozen=True, eq=False)
class _Response:
    """Of J touches: ``read`` (J,3) variances of log force, x and y by a reading's noise, and ``squares`` (J,3,3), how
    much of each a variance of the first three ``MODES`` makes; the others lie across them all and make none."""

    read: Array
    squares: Array

    @classmethod
    def of(cls, table: ResponseTable, contact_m: Array, force_n: Array) -> _Response:
        slope = slopes(table, contact_m, force_n)[:, :3]
        known = np.linalg.inv(np.einsum("jad,jbd->jab", slope, slope))
        across = np.einsum("jad,jbd->jab", modes(table, contact_m, force_n)[:, :3], slope)
        return cls(np.diagonal(known, axis1=1, axis2=2), (across @ known) ** 2)

    def errors(self, variance: Array) -> tuple[Array, Array]:
        """(J,) variances of the log force and of the place in m^2, under variances (J,6) of the ``MODES``."""
        size, x, y = (np.einsum("jab,ja->jb", self.squares, variance[:, :3]) + self.read).T
        return size, SHAPE_M**2 * (x + y)


def likely(found: list[tuple[float, Process]]) -> list[tuple[float, Process]]:
    """(share, process) of those that are likely, from their log likelihoods."""
    logs = np.array([log - 0.5 * (np.log10(one.variance / EXPECTED**2) / DECADES) ** 2 for log, one in found])
    share = np.exp(logs - logs.max())
    kept = share >= UNLIKELY
    share = share / share[kept].sum()
    return [(float(share[k]), found[k][1]) for k in np.flatnonzero(kept)]


def judged(table: ResponseTable, largest_n: float) -> tuple[Array, Array]:
    """(J,2) places and (J,) forces at which the sheet is judged: the middles of equal cells, some shares of a force."""
    x, y = table.grid.x_m, table.grid.y_m
    middle = middles_m(np.array([x[0], y[0]]), np.array([x[-1], y[-1]]))
    forces = largest_n * np.array(FORCE_SHARES)
    return np.repeat(middle, len(forces), axis=0), np.tile(forces, len(middle))


def middles_m(low_m: Array, high_m: Array) -> Array:
    """(n,2) middles of equal cells of ``CELL_M`` at most between two corners (2,)."""
    cells = np.ceil((high_m - low_m) / CELL_M - 1e-6).astype(int)
    x, y = (low_m[k] + (np.arange(cells[k]) + 0.5) / cells[k] * (high_m[k] - low_m[k]) for k in range(2))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def most_telling(design: PressDesign, place_m: Array, force_n: Array, wanted: Accuracy) -> tuple[int, Accuracy]:
    """Which of the places (C,2) is to be pressed next with the forces (F,), and the accuracy expected then."""
    after = design.accuracies(place_m, force_n)
    best = int(np.argmin([accuracy.cost(wanted) for accuracy in after]))
    return best, after[best]
