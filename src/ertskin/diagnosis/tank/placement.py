"""Whether a tank's electrodes sit where its file says: their places along the rim, from one empty scan.

What is read between electrodes depends on the outline and on their places by no more than where a conformal map to the
disk puts them: a squeezed outline, electrodes that slid along a round one, and a sheet that conducts better one way
than the other give the same readings. The places are fitted along the outline that the file gives, with the sheet
resistance, a slope of the conductance across the tank (uneven depth) and each electrode's contact.

The response between any two points of the rim is solved once on a ring of short electrodes and interpolated. Fitted are
relative errors, with robust weights, for what is wrong in a tank is its model (three dimensions, finite electrodes),
not the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.protocol import Protocol, pair_resistances, transfer_matrix
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import lagrange_weights

Array = NDArray[np.float64]

RING = 120
"""Short electrodes on the rim between which the response is interpolated."""
FILLED = 0.4
"""Part of the rim that they cover."""
ACCURACY = 0.05
"""Relative error that a two-dimensional model of a tank is trusted to: of each reading, and of the median one."""
USUAL = 0.1
"""Standard deviation of a shift supposed beforehand, over the radius: decides where conformal maps leave a choice."""
TOLERANCE = 0.1
"""Shift over the radius, two standard errors taken off, from which an electrode is out of place. Tanks glued by hand
(to 0.03 at most) exceed it once in 500: extreme-value fit to simulated ones, experiments/real/ottawa/nulls.py."""
NEEDED = 1.3
"""Readings held out must be predicted so many times better with the electrodes moved."""
FOLDS = 4


@dataclass(frozen=True, eq=False)
class Placement:
    """Shifts (L,) of the electrodes along the rim in metre with standard errors, NaN for those left aside.

    What a turn of the rim or a conformal map of the disk onto itself would do is taken off the shifts: no reading shows
    it. ``misfit_before``, ``misfit_after``: robust rms of readings held out, over ``ACCURACY``, with the places in the
    file and with those fitted. ``place_m``, ``moved_m`` (L,2): the places in the file, and those fitted.
    """

    shift_m: Array
    error_m: Array
    misfit_before: float
    misfit_after: float
    radius_m: float
    place_m: Array
    moved_m: Array

    @property
    def displaced(self) -> tuple[int, ...]:
        """The electrodes out of place, the furthest first; none where readings held out don't ask for it."""
        if self.misfit_before < NEEDED * self.misfit_after:
            return ()
        away = np.nan_to_num(np.abs(self.shift_m)) - 2 * np.nan_to_num(self.error_m)
        far = np.flatnonzero(away > TOLERANCE * self.radius_m)
        return tuple(int(k) for k in far[np.argsort(-np.abs(self.shift_m[far]))])


class Rim:
    """Responses between points of a tank's rim, at unit sheet resistance, to first order in the conductance's slope."""

    def __init__(self, sensor: Sensor) -> None:
        """Raises ``MeshError`` where the outline can't be meshed."""
        closed = np.vstack([sensor.outline_m, sensor.outline_m[:1]])
        self.arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
        self.closed, self.length_m = closed, float(self.arc[-1])
        middle = self.length_m * np.arange(RING) / RING
        half = 0.5 * FILLED * self.length_m / RING
        edge = np.stack([self.at(middle - half), self.at(middle + half)], axis=1)
        side = float(np.ptp(sensor.extent_m, axis=0).max())
        ring = replace(sensor, electrode_edge_m=edge, electrode_center_m=np.zeros((0, 2)))
        model = SheetModel(ring, Resolution(1, Grading(side / 30, side / 150, growth=4.0, spread=0.6)))
        solution = model.solve(model.uniform(1.0), np.full(RING, 1e2))
        low, high = sensor.extent_m
        slope = (2 * model.quadrature_m - (low + high)) / side
        change = solution.directional(np.moveaxis(slope, -1, 0))
        self.response = np.stack([transfer_matrix(pairs) for pairs in (solution.pair_resistance_ohm, *change)])

    def at(self, arc_m: Array) -> Array:
        """(n,2) points of the rim."""
        arc = np.mod(arc_m, self.length_m)
        return np.stack([np.interp(arc, self.arc, self.closed[:, k]) for k in range(2)], axis=-1)

    def arc_of(self, point_m: Array) -> Array:
        """(n,) places along the rim of the points (n,2) next to it."""
        arc = self.length_m * np.arange(20 * RING) / (20 * RING)
        away = np.linalg.norm(self.at(arc) - point_m[:, None], axis=-1)
        return np.asarray(arc[away.argmin(axis=1)])

    def transfer(self, arc_m: Array) -> Array:
        """(3,L,L) response between electrodes at these places, and its derivatives by the conductance's slopes."""
        place = np.mod(arc_m, self.length_m) / self.length_m * RING
        first = np.floor(place).astype(int)
        weight, near = np.zeros((len(place), RING)), np.arange(-1, 3)
        # Four-point interpolation: the response is a logarithm of the distance.
        share = lagrange_weights(near.astype(float), place - first)
        np.put_along_axis(weight, (first[:, None] + near) % RING, share, axis=1)
        return np.asarray(weight @ self.response @ weight.T)


@lru_cache(maxsize=2)
def rim_of(sensor: Sensor) -> Rim:
    """The sensor's rim, solved once for all scans of one tank. Raises ``MeshError``."""
    return Rim(sensor)


class PlacementFit:
    """One empty scan (K,M) in volt of a tank, to be explained with its electrodes moved or not."""

    def __init__(
        self,
        sensor: Sensor,
        protocol: Protocol,
        voltage_v: Array,
        noise_v: float,
        aside: tuple[int, ...],
        channels: tuple[int, ...] = (),
    ):
        """``aside``: electrodes whose readings aren't used, ``channels`` such columns; they are wrong by themselves."""
        assert sensor.electrode_edge_m is not None
        self.protocol, self.rim = protocol, rim_of(sensor)
        self.arc_m = self.rim.arc_of(sensor.electrode_edge_m.mean(axis=1))
        self.radius_m = self.rim.length_m / (2 * np.pi)
        weights, current = protocol.measurement, protocol.injection_current_a
        known = protocol.taken & weights.any(axis=2)
        if aside:
            bad = list(aside)
            known &= ~(weights[:, :, bad].any(axis=2) | current[:, None, bad].any(axis=2))
        known[:, list(channels)] = False
        self.known = known
        self.voltage = voltage_v[known]
        self.design = protocol.design[known.ravel()]
        size = np.abs(self.voltage)
        self.sigma = np.hypot(noise_v, ACCURACY * np.hypot(size, np.median(size)))
        i, j = np.triu_indices(protocol.electrodes, 1)
        ends = np.zeros((len(i), protocol.electrodes))
        ends[np.arange(len(i)), i] = ends[np.arange(len(j)), j] = 1.0
        self.contact = self.design @ ends
        self.seen = np.abs(self.contact).max(axis=0) > 1e-9 * np.abs(self.design).max()
        self.used = np.setdiff1d(np.arange(protocol.electrodes), aside)
        self.group = _groups(self.design)

    def linear(self, shift_m: Array) -> Array:
        """(n, 3+c) readings per unit of sheet resistance, of its slopes, and of each contact that shows."""
        arc = self.arc_m.copy()
        arc[self.used] += shift_m
        responses = self.rim.transfer(arc)
        sheet = [self.design @ pair_resistances(one) for one in responses]
        return np.column_stack([*sheet, self.contact[:, self.seen]])

    def residual(self, shift_m: Array, rows: NDArray[np.bool_], weight: Array) -> tuple[Array, Array]:
        """Errors (n,) over their scale with the linear unknowns fitted to ``rows``, and these unknowns."""
        design = self.linear(shift_m) / self.sigma[:, None]
        target = self.voltage / self.sigma
        root = np.sqrt(weight[rows])
        pull = 1e-3 * np.linalg.norm(design[rows, 0]) * np.eye(design.shape[1])
        pull[0] = 0.0
        pull[3:] *= np.linalg.norm(design[rows][:, 3:], axis=0).max(initial=0.0) / np.linalg.norm(design[rows, 0])
        left = np.vstack([root[:, None] * design[rows], pull])
        right = np.concatenate([root * target[rows], np.zeros(len(pull))])
        value = np.linalg.lstsq(left, right, rcond=None)[0]
        return design @ value - target, value

    def moved(self, rows: NDArray[np.bool_], rounds: int = 3) -> tuple[Array, Array]:
        """Shifts (n,) in metre of the electrodes used that fit the readings ``rows`` best, and their errors."""
        shift, weight = np.zeros(len(self.used)), np.ones(len(self.voltage))
        usual = USUAL * self.radius_m
        for _ in range(rounds):
            used = weight

            def cost(x: Array, used: Array = used) -> Array:
                error = self.residual(usual * x, rows, used)[0]
                return np.concatenate([np.sqrt(used[rows]) * error[rows], x])

            fit = least_squares(cost, shift / usual, x_scale=0.1, diff_step=1e-3, bounds=(-8, 8), max_nfev=30)
            shift = usual * fit.x
            weight = _tukey(self.residual(shift, rows, used)[0])
        spread = max(1.0, robust_rms(self.residual(shift, rows, weight)[0][rows]))
        covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
        free = self._free()
        return shift, usual * spread * np.sqrt(np.maximum(np.diag(free @ covariance @ free), 0.0))

    def _free(self) -> Array:
        """(n,n) projection of shifts onto those that no conformal map of a disk onto itself undoes."""
        angle = 2 * np.pi * self.arc_m[self.used] / self.rim.length_m
        undone = np.linalg.qr(np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1))[0]
        return np.asarray(np.eye(len(angle)) - undone @ undone.T)

    def held_out(self) -> tuple[float, float]:
        """Robust rms of readings held out, in units of what the model is trusted to: as in the file, and moved."""
        as_drawn, moved = np.zeros(len(self.voltage)), np.zeros(len(self.voltage))
        even = np.ones(len(self.voltage))
        for fold in range(FOLDS):
            out = self.group % FOLDS == fold
            start = self.residual(np.zeros(len(self.used)), ~out, even)[0]
            as_drawn[out] = self.residual(np.zeros(len(self.used)), ~out, _tukey(start))[0][out]
            shift, _ = self.moved(~out, rounds=2)
            weight = _tukey(self.residual(shift, ~out, even)[0])
            moved[out] = self.residual(shift, ~out, weight)[0][out]
        return robust_rms(as_drawn), robust_rms(moved)

    def fit(self) -> Placement:
        """The electrodes' places, and how well readings held out are predicted with them and without."""
        before, after = self.held_out()
        shift, error = self.moved(np.ones(len(self.voltage), dtype=bool))
        shift = self._free() @ shift
        every = np.full((2, self.protocol.electrodes), np.nan)
        every[:, self.used] = shift, error
        place = self.rim.at(self.arc_m)
        moved = self.rim.at(self.arc_m + np.nan_to_num(every[0]))
        return Placement(every[0], every[1], before, after, self.radius_m, place, moved)


def robust_rms(error: Array) -> float:
    """Root mean square with errors beyond three robust standard deviations drawn in to there."""
    scale = 3 * 1.4826 * float(np.median(np.abs(error)))
    return float(np.sqrt(np.mean(np.clip(error, -scale, scale) ** 2)))


def _tukey(error: Array) -> Array:
    """Tukey's weights, nowhere nought for all."""
    scale = max(1.4826 * float(np.median(np.abs(error))), 1e-12)
    return np.asarray(np.clip(1 - (error / (6 * scale)) ** 2, 1e-6, None) ** 2)


def _groups(design: Array) -> NDArray[np.intp]:
    """(n,) number of each reading's kind: reciprocal ones are of a kind, and held out together."""
    largest = np.abs(design).argmax(axis=1)
    upright = design * np.sign(design[np.arange(len(design)), largest])[:, None]
    scaled = np.round(upright / np.abs(design).max(), 9)
    return np.asarray(np.unique(scaled, axis=0, return_inverse=True)[1]).ravel()
