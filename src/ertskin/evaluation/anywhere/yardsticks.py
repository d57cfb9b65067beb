"""What simple methods and the physics itself make of touches anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.data.anywhere import AnywhereSkin, force_map_n
from ertskin.data.split import split
from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.evaluation.yardsticks import GaussNewtonImaging, KernelRidge
from ertskin.evaluation.yardsticks.imaging_jacobian import imaging_jacobian
from ertskin.evaluation.yardsticks.peaks import highest_near
from ertskin.evaluation.yardsticks.yardstick import Yardstick
from ertskin.physics.conduction.sheet import Solution
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]

LEAST_N = 0.15
"""Contacts lighter than this are none, as for the network."""
LESSON_ROWS, HELD_OUT_ROWS = 6000, 1000
THRESHOLDS_N = np.linspace(0.05, 1.5, 30)
SPLAT = 0.7
"""Width of a contact in the maps kernel ridge learns, in spacings of the lattice."""


@dataclass(frozen=True, eq=False)
class _Lesson:
    """Noisy whitened changes (N,P) of contacts (N,C,2) with forces (N,C); others held out, and how many contacts
    those have."""

    change_v: Array
    contact_m: Array
    force_n: Array
    held_out_v: Array
    held_out_count: NDArray[np.int64]

    @classmethod
    def of(cls, skin: AnywhereSkin, seed: int) -> _Lesson:
        rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
        rows, held_out = split(len(skin.force_n), seed)
        rows, held_out = rng.permutation(rows)[:LESSON_ROWS], rng.permutation(held_out)[:HELD_OUT_ROWS]
        trials = skin.trials(np.concatenate([rows, held_out]))
        clean_v = trials.coordinates_v(skin.protocol)
        learned, asked = (skin.noise.coordinates(rng, len(some)) for some in (rows, held_out))
        first, last = slice(len(rows)), slice(len(rows), None)
        return cls(
            clean_v[first] + learned,
            trials.contact_m[first],
            trials.force_n[first],
            clean_v[last] + asked,
            trials.contacts[last],
        )


class AnywhereYardsticks:
    """Each yardstick's result on true contacts (N,C) with changes (N,P), taught by trials on the ``skin``."""

    def __init__(
        self,
        skin: AnywhereSkin,
        rest: Callable[[], Solution],
        change_v: Array,
        outcome: Callable[[Array, Array, Array | None], ContactOutcome],
        seeds: Sequence[int],
    ) -> None:
        self.skin, self.model, self.rest = skin, skin.model, rest
        self.change_v, self.outcome, self.seeds = change_v, outcome, seeds
        self._lessons: dict[int, _Lesson] = {}
        grid = self.model.table.grid
        self.lattice_m = _lattice(grid.x_m, grid.y_m)
        apart = np.linalg.norm(self.lattice_m[:, None] - self.lattice_m, axis=-1)
        self.near = apart < 1.6 * apart[apart > 0].min()

    def kernel_ridge(self) -> MethodResult:
        """Taught contacts at continuous places, as hills of force on a lattice."""
        return self._taught("kernel ridge", lambda seed: KernelRidge(seed=seed), _splat)

    def imaging(self) -> MethodResult:
        """One Gauss-Newton step; peaks of the image are contacts."""
        jacobian_v, pixel_m = imaging_jacobian(self.rest(), self.skin.protocol)

        def build(seed: int) -> Yardstick:
            return GaussNewtonImaging(jacobian_v, pixel_m, self.lattice_m)

        return self._taught("Gauss-Newton imaging", build, force_map_n)

    def oracle(self) -> MethodResult:
        """The most likely contacts under the calibrated physics, searched for without a network."""
        beliefs = self.model.posterior(LEAST_N).of(self.change_v @ self.model.matrix)
        outcome = self.outcome(beliefs.contact_m, beliefs.force_n, beliefs.covariance)
        run = SeedResult(0, contact_scores(outcome), contacts=outcome)
        return MethodResult("oracle", "yardstick", (run,), "most likely contacts under the calibrated physics")

    def bound(self) -> MethodResult:
        """What no unbiased method can go below, places and number known (Cramér 1946, Rao 1945)."""
        outcome = self.outcome(
            np.full((len(self.change_v), 1, 2), np.nan), np.full((len(self.change_v), 1), np.nan), None
        )
        scores: dict[str, Score] = {}
        blank = np.full(len(outcome.taxel_m), np.nan)
        for count in np.unique(outcome.true_count[outcome.true_count > 0]):
            rows = outcome.true_count == count
            place_m, force_n = contact_bounds(self.model.table, outcome.true_m[rows], outcome.true_n[rows])
            for name, value in (
                (f"location_error_mm_{count}", 1e3 * 0.5 * np.sqrt(np.pi) * place_m.mean()),
                (f"force_error_n_{count}", np.sqrt(np.mean(force_n**2))),
            ):
                scores[name] = Score(name, float(value), blank)
        return MethodResult("Cramér-Rao bound", "bound", (SeedResult(0, scores),), "no unbiased estimate can do better")

    def _taught(
        self, name: str, build: Callable[[int], Yardstick], maps_n: Callable[[Array, Array, Array], Array]
    ) -> MethodResult:
        """A yardstick by seed; ``maps_n`` makes what it learns (N,n) of contacts (N,C,2), (N,C) and a lattice (n,2)."""
        runs = []
        for seed in self.seeds:
            lesson = self._lesson(seed)
            taught_n = maps_n(lesson.contact_m, lesson.force_n, self.lattice_m)
            yardstick = build(seed).fit(lesson.change_v, taught_n)
            threshold_n = self._tuned_n(yardstick.predict(lesson.held_out_v), lesson.held_out_count)
            place_m, force_n = self._peaks(yardstick.predict(self.change_v), threshold_n)
            outcome = self.outcome(place_m, force_n, None)
            runs.append(SeedResult(seed, contact_scores(outcome), contacts=outcome))
        return MethodResult(name, "yardstick", tuple(runs))

    def _lesson(self, seed: int) -> _Lesson:
        """The same for every yardstick."""
        if seed not in self._lessons:
            self._lessons[seed] = _Lesson.of(self.skin, seed)
        return self._lessons[seed]

    def _tuned_n(self, maps_n: Array, count: NDArray[np.int64]) -> float:
        """The threshold above which the maps' peaks are as many as the contacts ``count`` (N,) most often."""
        top, total = self._tops(maps_n)
        right = [np.mean((top & (total > max(level, LEAST_N))).sum(axis=1) == count) for level in THRESHOLDS_N]
        return float(THRESHOLDS_N[int(np.argmax(right))])

    def _tops(self, maps_n: Array) -> tuple[NDArray[np.bool_], Array]:
        """(N,n) where a map is higher than all round, and (N,n) the force of each neighbourhood."""
        positive = np.maximum(maps_n, 0.0)
        return positive >= highest_near(positive, self.near), positive @ self.near.T

    def _peaks(self, maps_n: Array, threshold_n: float) -> tuple[Array, Array]:
        """(N,D,2) and (N,D): the map's peaks above a threshold; a peak's force is that of its neighbourhood."""
        near, positive = self.near, np.maximum(maps_n, 0.0)
        top, total = self._tops(maps_n)
        peak = top & (total > max(threshold_n, LEAST_N))
        most = max(1, int(peak.sum(axis=1).max(initial=0)))
        order = np.argsort(~peak, axis=1, kind="stable")[:, :most]
        present = np.take_along_axis(peak, order, axis=1)
        centroid = (positive @ (near[..., None] * self.lattice_m).swapaxes(0, 1).reshape(len(near), -1)).reshape(
            len(maps_n), -1, 2
        ) / np.maximum(total, 1e-12)[..., None]
        place = np.take_along_axis(centroid, order[..., None], axis=1)
        force = np.take_along_axis(total, order, axis=1)
        return np.where(present[..., None], place, np.nan), np.where(present, force, np.nan)


def contact_bounds(table: ResponseTable, contact_m: Array, force_n: Array) -> tuple[Array, Array]:
    """(M,) least rms error of place in metres and of force in newton of each of the contacts (N,C)."""
    places, forces = [], []
    for place, force in zip(contact_m, force_n, strict=True):
        present = np.isfinite(force) & np.isfinite(place).all(axis=1)
        slope = table.tangents(place[present], force[present])[:, 1:4].reshape(-1, table.response.shape[3])
        covariance = np.linalg.inv(slope @ slope.T)
        variance = np.diagonal(covariance).reshape(-1, 3)
        places += list(np.sqrt(variance[:, 0] + variance[:, 1]))
        forces += list(np.sqrt(variance[:, 2]))
    return np.array(places), np.array(forces)


def _lattice(x_m: Array, y_m: Array, spacing_m: float = 0.01) -> Array:
    x, y = (np.linspace(a[0], a[-1], round((a[-1] - a[0]) / spacing_m) + 1) for a in (x_m, y_m))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _splat(contact_m: Array, force_n: Array, lattice_m: Array) -> Array:
    """(N,n) every contact's force spread over the lattice as a hill of that sum."""
    apart = np.linalg.norm(lattice_m[:, None] - lattice_m, axis=-1)
    width = SPLAT * apart[apart > 0].min()
    maps = np.zeros((len(force_n), len(lattice_m)))
    rows, slots = np.nonzero(np.isfinite(force_n))
    away2 = ((contact_m[rows, slots, None] - lattice_m) ** 2).sum(axis=2)
    hill = np.exp(-0.5 * away2 / width**2)
    np.add.at(maps, rows, force_n[rows, slots, None] * hill / hill.sum(axis=1, keepdims=True))
    return maps
