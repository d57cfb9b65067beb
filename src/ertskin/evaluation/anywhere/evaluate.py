"""Networks and yardsticks on a recording of touches anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig, open_dict

from ertskin.data.anywhere import anywhere_skin, skin_at_rest
from ertskin.data.touches import Touches, touches_of
from ertskin.errors import UserError
from ertskin.evaluation.anywhere.yardsticks import AnywhereYardsticks
from ertskin.evaluation.contact_outcome import ContactOutcome, contacts_said
from ertskin.evaluation.followed import seen_by
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.evaluation.novelty import NOVEL, novel_rate, novelty_of
from ertskin.evaluation.results import MethodResult, SeedResult
from ertskin.hardware.recording import Recording
from ertskin.models.reconstruction import Reconstruction

Array = NDArray[np.float64]

CONTINUOUS = ("kernel_ridge", "imaging", "oracle", "bound")
"""Yardsticks that answer between the taxels."""


def evaluate_anywhere(
    config: DictConfig,
    training: Recording,
    recording: Recording,
    groups: dict[str, dict[int, Reconstruction]],
    say: Callable[[str], None],
) -> tuple[list[MethodResult], list[str]]:
    """Every network's and yardstick's scores on ``recording``, and what a person should know; ``UserError`` where its
    scans or contacts don't fit."""
    touches, remarks = touches_of(recording), []
    if not np.isfinite(touches.history.force_n[touches.history.touched]).all():
        raise UserError("anywhere: contacts without a force can't be judged; the recording must hold force_n")
    results = []
    for name, trained in groups.items():
        say(f"{name}, anywhere")
        runs = []
        for seed, one in trained.items():
            seen, course = seen_by(one, recording, touches, bool(config.follow))
            runs.append(_run(seed, one, seen))
            remarks += course
        results.append(MethodResult(name, "network", tuple(runs)))
    wanted = [name for name in CONTINUOUS if name in config.yardsticks]
    if wanted:
        say("tabulated response")
        learned = config.copy()
        with open_dict(learned):
            learned.data = learned.anywhere_data
        taxel_m = next(iter(next(iter(groups.values())).values())).network.answers_m
        yardsticks = AnywhereYardsticks(
            anywhere_skin(learned, training),
            lambda: skin_at_rest(learned, training),
            touches.change_v,
            lambda place_m, force_n, covariance: _outcome(touches, place_m, force_n, taxel_m, covariance),
            range(int(config.yardstick_seeds)),
        )
        for name in wanted:
            say(f"{name.replace('_', ' ')}, anywhere")
            results.append(getattr(yardsticks, name)())
    return results, list(dict.fromkeys(remarks))


def merged(methods: Sequence[MethodResult], more: Sequence[MethodResult]) -> list[MethodResult]:
    """The methods with the further scores of others of their name, seed by seed; then those not known yet."""
    by_name = {method.name: method for method in more}
    joined = []
    for method in methods:
        other = by_name.pop(method.name, None)
        seeds = {} if other is None else {run.seed: run for run in other.runs}
        runs = tuple(
            run
            if run.seed not in seeds
            else SeedResult(
                run.seed, run.scores | seeds[run.seed].scores, run.outcome, run.run_id, seeds[run.seed].contacts
            )
            for run in method.runs
        )
        joined.append(replace(method, runs=runs))
    return joined + list(by_name.values())


def _run(seed: int, trained: Reconstruction, touches: Touches) -> SeedResult:
    if trained.protocol.design.shape != touches.protocol.design.shape:
        raise UserError("anywhere: scanned with another protocol than the training recording")
    estimate = (
        trained.estimate_coordinates(touches.change_v)
        if trained.network.reads == "coordinates"
        else trained.estimate(np.asarray(touches.readings_v, dtype=float))
    )
    taxel_m = trained.network.answers_m
    outcome = _outcome(touches, *contacts_said(estimate, taxel_m), taxel_m, estimate.covariance)
    scores = contact_scores(outcome)
    if (novelty := novelty_of(trained, touches, estimate)) is not None:
        for count in np.unique(outcome.true_count[outcome.true_count > 0]):
            scores |= novel_rate(novelty[outcome.true_count == count], taxel_m, f"{NOVEL}_{count}")
    return SeedResult(seed, scores, None, trained.about.get("run_id"), outcome)


def _outcome(
    touches: Touches, place_m: Array, force_n: Array, taxel_m: Array, covariance: Array | None
) -> ContactOutcome:
    history = touches.history
    true_m = np.where(history.touched[..., None], history.contact_m, np.nan)
    return ContactOutcome(
        true_m, np.where(history.touched, history.force_n, np.nan), place_m, force_n, taxel_m, covariance
    )
