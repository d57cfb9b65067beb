"""What the terms that entered are worth: backward, without those that the others have made superfluous."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.behind_fields import loss_with_fields
from ertskin.diagnosis.search.chosen import Chosen, Rivals, carried, key_of
from ertskin.diagnosis.search.forms import freer
from ertskin.diagnosis.search.gain import gained
from ertskin.diagnosis.search.pressed_places import fields_by_place, part_missed
from ertskin.diagnosis.search.trials import is_worth_a_name, residual_count
from ertskin.physics.effects.effect import shown_by
from ertskin.physics.effects.hypothesis import Signal


def backward(
    problem: VoltageProblem,
    current: Solved,
    fixed: int,
    partitions: Sequence[Sequence[int]],
    stand: dict[str, Rivals],
) -> tuple[tuple[Chosen, ...], Solved]:
    """Drop terms the others have made superfluous; what each of the rest is worth."""
    frames = residual_count(problem)
    while True:
        instrument = any(shown_by(t.effect, Signal.NONRECIPROCAL) for t in current.terms)
        if instrument or current.leftover:
            # With the instrument's last term what no network explains counts no longer.
            current = problem.solve(current.terms, current.calibration, steps=2, leftover=instrument)
        chosen, dropped = [], None
        for k in range(fixed, len(current.terms)):
            term = current.terms[k]
            without = _without(problem, current, k, instrument, partitions)
            carried(stand, [t for i, t in enumerate(current.terms) if i != k], without.terms)
            loss = gained(without, current, partitions, problem.evidence.criteria)
            if not is_worth_a_name(problem, current, term, loss):
                loss = max(loss, loss_with_fields(problem, current, without, k))
            if not is_worth_a_name(problem, current, term, loss) and (dropped is None or loss < dropped[0]):
                dropped = (loss, without)
            # The instrument's terms gain in every reading, the others in the pairs.
            width = problem.evidence.protocol.orthonormal.shape[0 if shown_by(term.effect, Signal.NONRECIPROCAL) else 1]
            alone = float(np.sqrt(1 + 2 * max(loss, 0.0) / (frames * width / problem.evidence.scan_v.shape[1])))
            chosen.append(Chosen(term, loss, alone, stand.get(key_of(term), ())))
        if dropped is None:
            return tuple(chosen), current
        current = dropped[1]


def _without(
    problem: VoltageProblem, current: Solved, number: int, leftover: bool, partitions: Sequence[Sequence[int]]
) -> Solved:
    """The fit without the term of this ``number``, what else the instrument does in a freer form where that gains.

    An empty capacitor that a first channel finds is a gain of that channel, beside channels that find no empty one.
    """
    rest = [term for k, term in enumerate(current.terms) if k != number]
    without = problem.solve(rest, current.calibration, steps=5, leftover=leftover)
    if not shown_by(current.terms[number].effect, Signal.NONRECIPROCAL):
        return without
    for k, term in enumerate(rest):
        for form in freer(term) if shown_by(term.effect, Signal.NONRECIPROCAL) else []:
            terms = [*without.terms[:k], form, *without.terms[k + 1 :]]
            freed = problem.solve(terms, without.calibration, leftover=leftover, hopeless=without.cost)
            gain = gained(without, freed, partitions, problem.evidence.criteria)
            without = freed if gain > problem.evidence.criteria.significant_gain else without
    return without


def with_lag(
    problem: VoltageProblem, current: Solved, number: int, chosen: Chosen, partitions: Sequence[Sequence[int]]
) -> Chosen:
    """The term of this ``number`` with what the fit, the specimen's included, loses where it follows presses at
    once."""
    term = current.terms[number]
    at_once = term.effect.at_once(term.free)
    if at_once is None:
        return chosen
    terms = [*current.terms[:number], Term(at_once.effect, at_once.free), *current.terms[number + 1 :]]
    static = problem.solve(terms, current.calibration, leftover=current.leftover)
    of_specimen = float(static.fit.quadratic.cost[-1] - current.fit.quadratic.cost[-1])
    return replace(chosen, by_lag=gained(static, current, partitions, problem.evidence.criteria) + of_specimen)


def with_fields_by_place(
    build: Problem, incumbent: CheckedFit, chosen: tuple[Chosen, ...], partitions: Sequence[Sequence[int]]
) -> tuple[tuple[Chosen, ...], CheckedFit]:
    """The terms chosen, fields with how well places by themselves tell of them.

    The first one that predicts little and fits no better, or that predicts worse than nothing, is told so, last of
    the terms.
    """
    fits = fields_by_place(build, incumbent, len(incumbent.solved.terms) - len(chosen))
    found = [
        one if fit is None else replace(one, by_place=(fit[0].misfit, fit[1].misfit))
        for one, fit in zip(chosen, fits, strict=True)
    ]
    for number, fit in enumerate(fits):
        if fit is None or fit[1] is incumbent:
            continue
        missed = part_missed(incumbent, fit[0], partitions)
        if missed < (1.0 if fit[1].spoils(incumbent) else 1 - incumbent.problem.evidence.criteria.most_share):
            continue
        by_place = replace(found[number], term=fit[1].solved.terms[-1])
        return (*found[:number], *found[number + 1 :], by_place), fit[1]
    return tuple(found), incumbent
