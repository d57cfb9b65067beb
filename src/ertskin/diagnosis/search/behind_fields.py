"""What a smooth field stands in for: terms of few numbers that are likelier beside a field of another covariance.

A field short and wide enough follows any cause that is sharp in one place, a pad out of place by the hill under it, and
leaves nothing. It is dear: without that cause a field of less spread or of greater length does, and that tells. Sets
are therefore compared with each field's covariance the likeliest one, by evidence (MacKay, Neural Comput. 4 (1992)
415), not with the one at hand, under which the cause has nothing left to explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.search.candidates import Candidate, Direction, like_a_field
from ertskin.diagnosis.search.gain import freedom
from ertskin.diagnosis.search.smooth_fields import SPREADS, NodeQuadratic, covariances, evidences
from ertskin.diagnosis.search.trials import rms_of, unlikely

Array = NDArray[np.float64]


def smooth_fields_of(solved: Solved, fixed: int = 0) -> list[int]:
    """Numbers of a fit's terms, from ``fixed`` on, that are smooth fields; what is told place by place is none."""
    terms = enumerate(solved.terms)
    return [number for number, term in terms if number >= fixed and term.modes is not None and not term.by_place]


def behind_field(problem: VoltageProblem, solved: Solved, number: int) -> list[Candidate]:
    """Terms that the field of the term ``number`` may stand in for, with the evidence that each gains, likeliest first.

    To first order about the fit with the field, the covariance chosen anew beside each.
    """
    current = problem.at_hand(solved)
    directions = list(like_a_field(problem, current, current.terms[number]))
    if not directions:
        return []
    added = np.concatenate([one.columns for one in directions], axis=-1).astype(np.float32)
    reduced = _reduced(problem, current, number, added)
    found = _evidence_gained(*reduced, directions, problem.evidence.sensor.extent_m)
    candidates = [
        Candidate(one.begun(value), gain) for one, (gain, value) in zip(directions, found, strict=True) if gain > 0
    ]
    return sorted(candidates, key=lambda candidate: -candidate.gain)


def spare_evidence(problem: VoltageProblem, solved: Solved) -> float:
    """By how much a fit's smooth fields would be likelier under the likeliest covariance of each, to first order.

    No more than their freedom costs: readings a hundred thousand times their noise leave that first order rounded off.
    """
    current, extent_m = problem.at_hand(solved), problem.evidence.sensor.extent_m
    spare = 0.0
    for number in smooth_fields_of(current):
        modes = current.terms[number].modes
        assert modes is not None
        reduced = _reduced(problem, current, number)
        found = np.array([evidences(half, *reduced) for half in covariances(extent_m)])
        spare += max(0.0, float(found.max() - evidences(modes.half, *reduced, [modes.spread])[0]))
    return min(spare, freedom(current))


def loss_with_fields(problem: VoltageProblem, solved: Solved, without: Solved, number: int) -> float:
    """Half chi-square that a term of few numbers is worth beside smooth fields that may stand in for it: what it
    explains with all others as they are; minus infinity where there are none, or where the fit ``without`` it isn't
    significantly less likely.

    Beside a field that has taken its place it is worth hardly anything, however much it explains.
    """
    kin = solved.terms[number].effect.hypothesis.kin
    fields = [solved.terms[k].effect for k in smooth_fields_of(solved) if k != number]
    if solved.terms[number].modes is not None or not any(field.hypothesis.kin & kin for field in fields):
        return -np.inf
    evidence = [unlikely(one) - spare_evidence(problem, one) for one in (without, solved)]
    significant = evidence[0] - evidence[1] > problem.evidence.criteria.significant_gain
    return solved.rise_without(number, others_stay=True) if significant else -np.inf


def _reduced(
    problem: VoltageProblem, current: Solved, number: int, added: NDArray[np.float32] | None = None
) -> tuple[Array, Array]:
    """Gradient (c+M,) and Hessian (c+M,c+M) of numbers added to a fit and of its field at the nodes, all others at
    their best. What the fit leaves counts as noise: of more than that no evidence is told."""
    gradient, hessian = NodeQuadratic.of(problem, current, current.effects, number, added).reduced()
    noise = max(1.0, rms_of(current)) ** 2
    return gradient / noise, hessian / noise


def _evidence_gained(
    gradient: Array, hessian: Array, directions: Sequence[Direction], extent_m: Array
) -> list[tuple[float, Array]]:
    """What each direction gains in evidence beside a field of the covariance likeliest with it over that likeliest
    without, and its values there; of the numbers the directions' columns come first."""
    counts = [one.columns.shape[-1] for one in directions]
    first = np.concatenate([[0], np.cumsum(counts)])
    blocks = [slice(a, b) for a, b in pairwise(first)]
    without, best = -np.inf, [(-np.inf, np.zeros(count)) for count in counts]
    for half in covariances(extent_m):
        of_field = evidences(half, gradient[first[-1] :], hessian[first[-1] :, first[-1] :])
        without = max(without, float(of_field.max()))
        for pull, curved, evidence in zip(*_marginal(gradient, hessian, int(first[-1]), half), of_field, strict=True):
            for k, block in enumerate(blocks):
                value = np.linalg.lstsq(curved[block, block], pull[block], rcond=1e-10)[0]
                gain = 0.0 if directions[k].positive and value[0] <= 0 else 0.5 * float(pull[block] @ value)
                best[k] = max(best[k], (evidence + gain, value), key=lambda pair: pair[0])
    return [(float(evidence - without), value) for evidence, value in best]


def _marginal(gradient: Array, hessian: Array, added: int, half: Array) -> tuple[Array, Array]:
    """Gradients (S,c) and Hessians (S,c,c) of the first ``added`` numbers, the field behind them integrated out under a
    covariance (M,J) of each of the ``SPREADS``."""
    size, vector = np.linalg.eigh(half.T @ hessian[added:, added:] @ half)
    through = half @ vector
    along, cross = through.T @ gradient[added:], hessian[:added, added:] @ through
    variance = np.square(SPREADS)[:, None]
    kept = variance / (1 + variance * np.maximum(size, 0.0))
    pull = gradient[:added] - (kept * along) @ cross.T
    return pull, hessian[:added, :added] - np.einsum("cj,sj,dj->scd", cross, kept, cross)
