"""Every method on the same test frames: networks, yardsticks and the bound, seed by seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.data.split import split
from ertskin.data.touches import Touches
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.novelty import novel_rate, novelty_of
from ertskin.evaluation.outcome import Array, Outcome
from ertskin.evaluation.predictions import evaluate_outcome, tuned_threshold_n
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.evaluation.yardsticks import Yardstick
from ertskin.evaluation.yardsticks.cramer_rao import force_bound_n
from ertskin.evaluation.yardsticks.forward import Response

if TYPE_CHECKING:
    from ertskin.data.material import Material
    from ertskin.models.estimate import Estimate
    from ertskin.models.reconstruction import Reconstruction


MOST_HELD_OUT = 2000
"""Rows a threshold is tuned on."""


@dataclass(frozen=True, eq=False)
class TestFrames:
    """N touched frames to test on; n taxels, P pairs of electrodes, R readings.

    ``change_v`` (N,P): whitened changes, spikes left out. ``readings_v`` (N,R): the raw changes. ``true_map_n`` (N,n):
    load-cell force on each taxel. ``contact_m`` (N,C,2): true places, NaN for none. ``zero_variance`` (N,): of the zero
    that changes count from, in units of the noise's; ``rest_frames``: how many there are at least.
    """

    __test__ = False

    taxel_m: Array
    change_v: Array
    readings_v: Array
    true_map_n: Array
    contact_m: Array
    zero_variance: Array
    rest_frames: int

    @classmethod
    def of(cls, touches: Sequence[Touches], taxel_m: Array, within_m: float) -> TestFrames:
        """The frames of several recordings on one skin; ``UserError`` where a contact is off the taxels' grid."""
        most = max(part.history.contact_m.shape[1] for part in touches)
        places = [
            np.pad(
                part.history.contact_m,
                [(0, 0), (0, most - part.history.contact_m.shape[1]), (0, 0)],
                constant_values=np.nan,
            )
            for part in touches
        ]
        return cls(
            taxel_m,
            np.concatenate([part.change_v for part in touches]),
            np.concatenate([part.readings_v for part in touches], dtype=float),
            np.concatenate([part.force_map_n(taxel_m, within_m) for part in touches]),
            np.concatenate(places),
            np.concatenate([part.zero_variance for part in touches]),
            min(len(part.rest_v) for part in touches),
        )

    def outcome(self, map_n: Array, present: NDArray[np.bool_], located_m: Array | None = None) -> Outcome:
        """An estimate of these frames beside the truth."""
        return Outcome(self.true_map_n, map_n, present, self.taxel_m, self.contact_m, located_m)


@dataclass(frozen=True, eq=False)
class Lesson:
    """What a yardstick learns from: noisy whitened changes (N,P) in volt and force maps (N,n) in newton.

    The threshold above which a taxel counts as declared is tuned on the ``held_out`` rows, which it doesn't learn.
    """

    change_v: Array
    force_map_n: Array
    held_out_v: Array
    held_out_n: Array

    @classmethod
    def of(cls, material: Material, seed: int) -> Lesson:
        """The networks' own material, split as theirs, with noise drawn by ``seed``."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
        clean_v = material.trials.coordinates_v(material.protocol)
        noisy_v = clean_v + material.noise.coordinates(rng, len(clean_v))
        rows, held_out = split(len(clean_v), seed)
        held_out = rng.permutation(held_out)[:MOST_HELD_OUT]
        maps_n = material.trials.force_map_n
        return cls(noisy_v[rows], maps_n[rows], noisy_v[held_out], maps_n[held_out])


def network_result(
    name: str, trained: dict[int, Reconstruction], frames_of: Callable[[Reconstruction], TestFrames], note: str = ""
) -> MethodResult:
    """A network's trainings by seed, each on the test frames as it is to see them; one that reads raw readings gets
    them as they were read, spikes included."""
    runs = []
    for seed, reconstruction in trained.items():
        frames = frames_of(reconstruction)
        reads_coordinates = reconstruction.network.reads == "coordinates"
        estimate: Estimate = (
            reconstruction.estimate_coordinates(frames.change_v)
            if reads_coordinates
            else reconstruction.estimate(frames.readings_v)
        )
        outcome = frames.outcome(estimate.force_map_n, estimate.present, estimate.contact_m)
        scores = evaluate_outcome(outcome) | novel_rate(novelty_of(reconstruction, frames, estimate), frames.taxel_m)
        runs.append(SeedResult(seed, scores, outcome, reconstruction.about.get("run_id")))
    return MethodResult(name, "network", tuple(runs), note)


def yardstick_result(
    build: Callable[[int], Yardstick], lessons: dict[int, Lesson], frames: TestFrames, note: str = ""
) -> MethodResult:
    """A yardstick, built for each seed and taught that seed's lesson."""
    runs, name = [], ""
    for seed, lesson in lessons.items():
        yardstick = build(seed).fit(lesson.change_v, lesson.force_map_n)
        name = yardstick.name
        threshold_n = tuned_threshold_n(lesson.held_out_n, yardstick.predict(lesson.held_out_v))
        said_n = yardstick.predict(frames.change_v)
        runs.append(_scored(seed, frames.outcome(said_n, said_n > threshold_n)))
    return MethodResult(name, "yardstick", tuple(runs), note)


def oracle_result(oracle: Yardstick, frames: TestFrames, note: str = "") -> MethodResult:
    """A yardstick that learns nothing and says by itself where contacts are: any force at all."""
    said_n = oracle.predict(frames.change_v)
    return MethodResult(oracle.name, "yardstick", (_scored(0, frames.outcome(said_n, said_n > 0)),), note)


def bound_result(response: Response, covariance_v2: Array | float, frames: TestFrames) -> MethodResult:
    """The Cramér-Rao bound of the forces, the touched taxels known: what no unbiased method can go below."""
    scores = {}
    for contacts, name in ((1, "force_rmse_one_n"), (2, "force_error_two_n")):
        maps_n = frames.true_map_n[(frames.true_map_n > 0).sum(axis=1) == contacts]
        if not len(maps_n):
            continue
        taxel = np.nonzero(maps_n)[1].reshape(len(maps_n), contacts)
        force_n = np.take_along_axis(maps_n, taxel, axis=1)
        scores[name] = _bound_score(name, taxel, force_bound_n(response, taxel, force_n, covariance_v2), frames)
    return MethodResult("Cramér-Rao bound", "bound", (SeedResult(0, scores),), "no unbiased estimate can do better")


def _bound_score(name: str, taxel: NDArray[np.intp], bound_n: Array, frames: TestFrames) -> Score:
    """RMS of the bound for an RMSE; for a mean absolute error that of a normal error, sqrt(2/pi) of its deviation."""

    def statistic(deviation_n: Array) -> float:
        if name == "force_rmse_one_n":
            return float(np.sqrt(np.mean(deviation_n**2)))
        return float(np.sqrt(2 / np.pi) * deviation_n.mean())

    taxels = range(len(frames.taxel_m))
    per_taxel = [statistic(bound_n[taxel == k]) if (taxel == k).any() else np.nan for k in taxels]
    return Score(name, statistic(bound_n), np.array(per_taxel))


def _scored(seed: int, outcome: Outcome) -> SeedResult:
    return SeedResult(seed, evaluate_outcome(outcome), outcome)
