"""Contacts that wander: what their paths, measured at rest, do to the scans, and whether something else does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.trials import may_drift
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]

SOLVED = 12
"""Rest frames at most that are solved in full."""


def is_path(effect: Effect) -> bool:
    """Whether an effect is the path of a contact that wanders."""
    return effect.hypothesis.measured == Measured.CONTACT_PATH


def without_paths(terms: Sequence[Term]) -> list[Term]:
    """The terms that aren't paths of contacts."""
    return [term for term in terms if not is_path(term.effect)]


def without_paths_of_drifting_channels(terms: Sequence[Term], protocol: Protocol) -> list[Term]:
    """The terms but for paths of contacts whose electrode is read by a channel that may drift.

    What a channel makes of its own electrode's potential is nearly what the contact's resistance makes of it.
    """
    channels = {int(getattr(term.effect, "channel", -1)) for term in terms if may_drift(term)} - {-1}
    drifting = {electrode for channel in channels for electrode in _mostly_read_by(channel, protocol)}
    return [t for t in terms if not (is_path(t.effect) and getattr(t.effect, "electrode", None) in drifting)]


def _mostly_read_by(channel: int, protocol: Protocol) -> list[int]:
    """The electrodes that a channel reads most: its own against a sink, two where neighbours are compared."""
    weight = np.abs(protocol.measurement[:, channel]).sum(axis=0)
    return np.flatnonzero(weight > 0.5 * weight.max()).tolist()


def changed_by_paths(problem: VoltageProblem, solved: Solved) -> list[tuple[Effect, Array]]:
    """Each path of a contact in a fit and what it does to the scans (T,P) of the frames fitted, in units of the noise,
    as linearised about the fit with it: of a contact that goes far no more than roughly."""
    effects = solved.effects
    paths = [number for number, effect in enumerate(effects) if is_path(effect)]
    others = [(*effects[:number], *effects[number + 1 :]) for number in paths]
    if not paths:
        return []
    with_all, *without = (problem.scan_residual(problem.family.skin(solved.calibration, e)) for e in (effects, *others))
    return [(effects[number], one - with_all) for number, one in zip(paths, without, strict=True)]


def as_good_at_rest(without: CheckedFit, with_paths: CheckedFit) -> bool:
    """Whether what changes between rest frames is explained ``without`` paths of contacts as well as ``with_paths``.

    Not where materially more is left then, nor where most of what the paths do there, and significantly much beyond
    chance, isn't done by anything else: a contact that settles may be sure and change hardly anything.
    """
    criteria = with_paths.problem.evidence.criteria
    left, kept = (_at_rest(fit, fit.solved.scan_residual) for fit in (without, with_paths))
    rise, noise = float((left**2).sum() - (kept**2).sum()), max(1.0, float((kept**2).mean())) if kept.size else 1.0
    if rise > (criteria.chance_ratio**2 - 1) * float((kept**2).sum()):
        return False
    if rise < 2 * criteria.significant_gain * noise:
        return True
    return rise < criteria.most_share * _done_at_rest(with_paths)


def _done_at_rest(fit: CheckedFit) -> float:
    """Sum of squares of what a fit's paths of contacts change between its rest frames, in units of the noise, some of
    them solved in full: a contact may go so far that nothing linear tells what it does."""
    problem, solved = fit.problem, fit.solved
    resting = np.flatnonzero(problem.evidence.rest & (problem.weight > 0))
    rows = resting[np.unique(np.linspace(0, len(resting) - 1, SOLVED).round().astype(int))]
    bare = replace(solved, terms=tuple(without_paths(solved.terms)))
    done = (problem.in_full(solved, rows) - problem.in_full(bare, rows)) / problem.evidence.noise_v
    done = problem.evidence.frames(rows).discounted(done)
    return float(((done - done.mean(axis=0)) ** 2).sum()) * len(resting) / len(rows)


def _at_rest(fit: CheckedFit, scans: Array) -> Array:
    """(R,P) what changes of scans (T,P) from one rest frame fitted to the next: what stands is the calibration's."""
    resting = scans[fit.problem.evidence.rest & (fit.problem.weight > 0)]
    return resting - resting.mean(axis=0) if len(resting) else resting
