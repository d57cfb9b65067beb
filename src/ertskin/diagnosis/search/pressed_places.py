"""A field told place by place: what presses show where one place doesn't predict another.

Of lots sewn together, wrinkles or a stain narrower than presses are apart nothing can be predicted where nothing has
pressed, so cells held out have no say. But one number for every pressed place explains its presses at every load; where
so few numbers explain most of what is missing and no effect of few numbers does, the field is there, known where
something has pressed and as unknown as beforehand elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.cross_validation import log_misfit_held_out, numbers_of
from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem, checked_fit
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Modes, Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.settling import where_it_settles
from ertskin.diagnosis.search.smooth_fields import MOST_MODES, SPREADS, covariance_half, node_shape
from ertskin.diagnosis.search.trials import is_worth_a_name, of_presses, unlikely
from ertskin.physics.effects.effect import Effect, Start
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.registry import effects_shown_by
from ertskin.physics.effects.smooth_field import field_design

Array = NDArray[np.float64]

SAME_M = 1e-4
"""Places nearer to one another than this are one."""
LENGTH = 0.07
"""Correlation length over the sheet's longer side, the shortest of all, with which places a finger apart tell nothing
of one another. Of four recordings with hidden fields one is likelier with it, three with a quarter, by 3 % at most."""
LEAST_SIZE = 1e-6
"""Part of the largest mode of the covariance among places from which on down its modes are left out."""
LEAST_SPREAD = 0.01
"""Least standard deviation of the logarithm over the places pressed: on `rig_a` what the pressure's form leaves next to
the rim is a thousandth of the signal."""


def with_field_by_place(build: Problem, incumbent: CheckedFit) -> tuple[CheckedFit, float] | None:
    """The fit with a field that only presses show told place by place, and the half chi-square that gains.

    None where little is missing or a field is in the fit, where it isn't worth a name, or where the places hardly
    differ.
    """
    problem, current = incumbent.problem, incumbent.solved
    if incumbent.misfit <= problem.evidence.criteria.mismatch_ratio or any(map(of_presses, current.terms)):
        return None
    for kind in effects_shown_by(Signal.READINGS):
        if not of_presses(Term(kind(), ())):
            continue
        proposed = _where_it_settles_by_place(build, incumbent, kind)
        gain = 0.0 if proposed is None else unlikely(current) - unlikely(proposed.solved)
        if proposed is not None and is_worth_a_name(problem, current, proposed.solved.terms[-1], gain):
            return proposed, gain
    return None


def explains_most(proposed: CheckedFit, without: CheckedFit) -> bool:
    """Whether a fit explains most of what another one misses."""
    left = 1 - without.problem.evidence.criteria.most_share
    return proposed.misfit**2 - 1 < left * (without.misfit**2 - 1)


def fields_by_place(build: Problem, fit: CheckedFit, fixed: int) -> list[tuple[CheckedFit, CheckedFit] | None]:
    """The fits without each field and with it told place by place, last of the terms, of all but the first ``fixed``;
    None for what isn't such a field, or is none where so few numbers explain less than half of it."""
    problem, current, found = fit.problem, fit.solved, list[tuple[CheckedFit, CheckedFit] | None]()
    for number, term in list(enumerate(current.terms))[fixed:]:
        if not of_presses(term):
            found.append(None)
            continue
        rest = [other for k, other in enumerate(current.terms) if k != number]
        without = checked_fit(problem, problem.solve(rest, _nominal(current), leftover=current.leftover))
        by_place = fit if term.by_place else _explaining_most(build, without, type(term.effect))
        found.append(None if by_place is None else (without, by_place))
    return found


def part_missed(field: CheckedFit, without: CheckedFit, partitions: Sequence[Sequence[int]]) -> float:
    """By what cells held out are missed with a field (rms, noise taken off), over that without it."""

    def missed(fit: CheckedFit) -> float:
        numbers = numbers_of(fit.problem, partitions).sum()
        unlikelihood = log_misfit_held_out(fit.problem, fit.solved, partitions)
        return float(np.sqrt(max(np.exp(2 * unlikelihood / numbers) - 1.0, 0.0)))

    return missed(field) / max(missed(without), 1e-12)


def _nominal(solved: Solved) -> Calibration:
    """The calibration with the nominal ratio of moduli, which may have run far to make up for the field."""
    return replace(solved.calibration, log_ratio=0.0)


def _explaining_most(build: Problem, without: CheckedFit, kind: type[Effect]) -> CheckedFit | None:
    """The fit with a field told place by place where it settles, if that explains most of what is missing."""
    proposed = _where_it_settles_by_place(build, without, kind)
    return proposed if proposed is not None and explains_most(proposed, without) else None


def _where_it_settles_by_place(build: Problem, without: CheckedFit, kind: type[Effect]) -> CheckedFit | None:
    """The fit with a field told place by place where it settles; None of too few places, or too many, or that hardly
    differ."""
    problem, begun = without.problem, without.solved
    place_m = pressed_places_m(problem)
    if not 1 < len(place_m) <= MOST_MODES:
        return None
    starts = cast(FieldOverSheet, kind()).beginnings(())
    solved = min((_told_by_place(problem, begun, start, place_m) for start in starts), key=unlikely)
    if _differ_by(problem, solved, place_m) < LEAST_SPREAD:
        return None
    return where_it_settles(build, problem, solved)


def _told_by_place(problem: VoltageProblem, begun: Solved, start: Start, place_m: Array) -> Solved:
    """The fit with a field told place by place at the places (K,2).

    A first fit tells by how much these differ, which is what is expected of those not pressed.
    """
    solved, spread = begun, SPREADS[-1]
    for _ in range(2):
        modes = modes_at(place_m, spread, problem.evidence.sensor.extent_m)
        term = Term(start.effect, start.free, modes, (0.0,) * len(modes.nodes))
        solved = problem.solve([*begun.terms, term.at(term.start)], _nominal(begun), leftover=begun.leftover)
        spread = _differ_by(problem, solved, place_m)
        if spread < LEAST_SPREAD:
            break
    return solved


def _differ_by(problem: VoltageProblem, solved: Solved, place_m: Array) -> float:
    """Standard deviation over the places (K,2) of the logarithm of the last term's field."""
    return float(np.std(logarithms(solved.effects[-1], place_m, problem.evidence.sensor.extent_m)))


def pressed_places_m(problem: VoltageProblem) -> Array:
    """(K,2) where the frames fitted press, in metre."""
    history = problem.evidence.history
    contact_m = history.contact_m[history.touched & (problem.weight > 0)[:, None]]
    rounded = np.round(contact_m[np.isfinite(contact_m).all(axis=-1)] / SAME_M).astype(np.int64)
    return np.asarray(np.unique(rounded, axis=0) * SAME_M)


def logarithms(effect: Effect, place_m: Array, extent_m: Array) -> Array:
    """(K,) logarithm of a field's factor at places (K,2)."""
    found = effect.map_at(place_m, extent_m)
    return np.zeros(len(place_m)) if found is None else found


def modes_at(place_m: Array, spread: float, extent_m: Array) -> Modes:
    """What values at places (K,2), of mean nought, say of a process: K - 1 modes of it.

    With K the covariance among the places and C that between nodes and places, C K^(-1/2) is all of the process that
    places tell of. Their mean is the law's: left free it drifts to whatever mends the law's form, and places that
    nothing has pressed are predicted badly.
    """
    half = covariance_half(extent_m, LENGTH)
    shape = node_shape(extent_m)
    at_places = field_design(shape, place_m, extent_m) @ half
    size, vector = np.linalg.eigh(at_places @ at_places.T)
    kept = size > LEAST_SIZE * size[-1]
    even = vector[:, kept].sum(axis=0) * np.sqrt(size[kept])
    uneven = np.linalg.svd(even[None, :])[2][1:].T
    nodes = spread * half @ at_places.T @ (vector[:, kept] / np.sqrt(size[kept])) @ uneven
    return Modes(nodes.T.reshape(-1, *shape), half, spread, by_place=True)
