"""One contact resistance per electrode from the unloaded scan (paper III-C, eq. 5), and the sheet's if it is unknown.

Both methods minimise |V_real - V_sim| over the readings. Only the part of the readings that a resistor network can give
depends on the unknowns, so the sum runs over the pair resistances in whitened coordinates (276 numbers for 6624).
Readings are potentials of the electrodes themselves: they hold the drop across a driven electrode's contact.

- ``gauss_newton``: derivatives by the adjoint. The unknowns' logarithms are what moves, so they stay positive; a step
  up is taken as R(1 + d), because readings are nearly linear in R: a start 100 times too low needs hardly more steps
  than one near by, where plain exp(d) would overshoot.
- ``direct_search``: the paper's, here a pattern search (Hooke & Jeeves, J. ACM 8 (1961) 212) over the logarithms, on a
  reduction of the sheet; no derivatives.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.calibration.contact_reduction import ContactReduction
from ertskin.physics.calibration.scan_space import ScanSpace
from ertskin.physics.conduction.sheet import SheetModel, Solution
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]

_STEPS = 40
_CONVERGED = 1e-2
"""A step is the last if it can't lower chi-square by more: it moves no combination by a tenth of its standard error."""

_ROUNDING = 1e-6
"""A rise of the misfit by less than this share is the solver's rounding, not a failed step."""

_SOLVED = 1e-8
"""Noise-free readings count as fitted at this share of the largest."""

_LARGEST_FALL = 2.0
_LARGEST_RISE = 30.0
_PRIOR_LOG_SD = 4.6
"""A contact resistance is within a hundred times the guess, up or down, with 68 % prior probability."""

_REACH = 1000.0
_NARROW = 3.0
_FIRST_STRIDE = 1.0
_WIDE_STRIDE = 1e-3
_LAST_STRIDE = 1e-6


@dataclass(frozen=True, eq=False)
class ContactFit:
    """Contact resistances (L,) in ohm with standard errors, and the sheet resistance in ohm per square.

    Standard errors hold for white reading noise of ``noise_v`` (given, or the residual's where that is larger);
    ``covariance`` (n,n) is of the unknowns in ohm, contacts first, the sheet resistance last if fitted. A contact that
    the readings can't tell has a standard error beyond its value. ``residual_v`` (n,): measured less simulated in
    ``ScanSpace`` coordinates; ``residual_rms_v`` its rms per degree of freedom. ``rms_before_v`` and ``rms_after_v``
    are over all readings (Fig. 7). ``evaluations`` counts solutions of the sheet, or of its reduction.
    """

    contact_resistance_ohm: Array
    standard_error_ohm: Array
    sheet_resistance_ohm_sq: float
    sheet_standard_error_ohm_sq: float
    covariance: Array
    noise_v: float
    residual_v: Array
    residual_rms_v: float
    rms_before_v: float
    rms_after_v: float
    method: str
    evaluations: int
    seconds: float


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """What is to be fitted: the model, the protocol and the mean unloaded readings (K,M) in volt, nought where
    none is taken.

    ``sheet_resistance_ohm_sq`` and ``guess_ohm`` (for every contact) are start values; the sheet's stays as it is
    unless ``fit_sheet``. ``noise_v`` is the noise of one mean reading where known; ``weight`` (K,M) how much each
    reading counts, all alike without it.
    """

    model: SheetModel
    protocol: Protocol
    voltage_v: Array
    sheet_resistance_ohm_sq: float
    guess_ohm: float
    fit_sheet: bool = False
    noise_v: float | None = None
    weight: Array | None = None

    def start(self) -> Array:
        """(n,) logarithms of the unknowns' start values."""
        values = np.full(self.model.electrodes + self.fit_sheet, float(self.guess_ohm))
        if self.fit_sheet:
            values[-1] = self.sheet_resistance_ohm_sq
        return np.log(values)

    def split(self, logs: Array) -> tuple[Array, float]:
        """Contact resistances (L,) and sheet resistance of the unknowns' logarithms (n,)."""
        values = np.exp(logs)
        sheet = float(values[-1]) if self.fit_sheet else self.sheet_resistance_ohm_sq
        return values[: self.model.electrodes], sheet

    @cached_property
    def space(self) -> ScanSpace:
        """Coordinates of the readings in which misfits are measured."""
        return ScanSpace.of(self.protocol, self.weight)

    @cached_property
    def _guessed(self) -> Solution:
        """At the guesses: fits change the contacts and scale everything, and the sheet need not be eliminated again."""
        guess = np.broadcast_to(self.guess_ohm, (self.model.electrodes,))
        return self.model.solve(self.model.uniform(self.sheet_resistance_ohm_sq), guess)

    def reading_rms(self, pair_resistance_ohm: Array) -> float:
        """Rms over all readings of measured less simulated, in volt (eq. 5 over the square root of their number)."""
        square = (self.voltage_v - self.protocol.readings(pair_resistance_ohm)) ** 2
        return float(np.sqrt(square.sum() / self.protocol.count))

    def linearised(self, logs: Array) -> tuple[Array, Array]:
        """Pair resistances (P,) of the full model and their derivatives (P,n) by the unknowns' logarithms, in ohm.

        Resistances scale together: the sheet's derivative follows from the contacts' (Euler's theorem).
        """
        contact, sheet = self.split(logs)
        scale = sheet / self.sheet_resistance_ohm_sq
        solution = self.model.solve_contacts(contact / scale, self._guessed)
        pairs = scale * solution.pair_resistance_ohm
        by_log = solution.jacobian_contact_resistance() * contact
        if self.fit_sheet:
            by_log = np.column_stack([by_log, pairs - by_log.sum(axis=1)])
        return pairs, by_log


def gauss_newton(problem: ContactProblem) -> ContactFit:
    """Fit by Gauss-Newton with Levenberg's damping where a step fails; raises ``RuntimeError`` without convergence.

    A contact that the readings can't tell (a passive one of a poor scan, or one much smaller than the sheet's own
    resistance) stays finite by a weak log-normal prior about the guess, which moves the others by less than a
    millionth of their value where the model explains the readings; where it doesn't, by what the misfit leaves open.
    """
    begun = time.perf_counter()
    measured, whiten = problem.space.coordinates(problem.voltage_v), problem.space.design
    logs = problem.start()
    pairs, slope = problem.linearised(logs)
    before = problem.reading_rms(pairs)
    if problem.fit_sheet:
        # all resistances in proportion: exact, and it takes a sheet resistance far off out of the first step
        simulated = whiten @ pairs
        scale = max(float(measured @ simulated) / float(simulated @ simulated), 1e-3)
        logs, pairs, slope = logs + np.log(scale), pairs * scale, slope * scale
    expected = logs.copy()
    residual, damping, evaluations = measured - whiten @ pairs, 0.0, 1
    for _ in range(_STEPS):
        jacobian = whiten @ slope
        pull = np.full(len(logs), (_noise(problem, jacobian, residual) / _PRIOR_LOG_SD) ** 2)
        pull[problem.model.electrodes :] = 0.0
        normal = jacobian.T @ jacobian + np.diag(pull)
        gradient = jacobian.T @ residual + pull * (expected - logs)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        move = np.where(step > 0, np.log1p(np.clip(step, 0, _LARGEST_RISE)), np.maximum(step, -_LARGEST_FALL))
        trial_pairs, trial_slope = problem.linearised(logs + move)
        evaluations += 1
        trial = measured - whiten @ trial_pairs
        cost = residual @ residual + pull @ (logs - expected) ** 2
        gain = cost - trial @ trial - pull @ (logs + move - expected) ** 2
        if gain < -_ROUNDING * cost:
            damping = max(4 * damping, 1e-2)
            continue
        converged = gradient @ np.linalg.solve(normal, gradient) < _CONVERGED * _noise(problem, jacobian, trial) ** 2
        logs, pairs, slope, residual = logs + move, trial_pairs, trial_slope, trial
        poor = gain > _ROUNDING * cost and gain < 0.25 * (2 * step @ gradient - step @ normal @ step)
        damping = max(4 * damping, 1e-2) if poor else (damping / 10 if damping > 1e-4 else 0.0)
        if converged:
            return _result(problem, logs, pairs, slope, before, "gauss_newton", evaluations, begun)
    raise RuntimeError(f"contact resistances did not converge in {_STEPS} Gauss-Newton steps")


def robust(
    problem: ContactProblem, method: Callable[[ContactProblem], ContactFit] = gauss_newton, rounds: int = 4
) -> ContactFit:
    """Fit again and again with readings far off the fit counting less (Tukey's weights), so that a reading or an
    electrode that is plainly wrong doesn't spoil the others. ``robust_weights`` tells which."""
    fit = method(problem)
    for _ in range(rounds):
        fit = method(replace(problem, weight=robust_weights(problem, fit)))
    return fit


def robust_weights(problem: ContactProblem, fit: ContactFit) -> Array:
    """(K,M) Tukey's weights of the readings' residuals about a fit: zero beyond 4.685 robust sigmas, never all zero."""
    pairs = problem.model.solve(
        problem.model.uniform(fit.sheet_resistance_ohm_sq), fit.contact_resistance_ohm
    ).pair_resistance_ohm
    residual = problem.voltage_v - problem.protocol.readings(pairs)
    sigma = max(1.4826 * float(np.median(np.abs(residual[problem.protocol.taken]))), 1e-300)
    return np.asarray(np.clip(1 - (residual / (4.685 * sigma)) ** 2, 0.0, None) ** 2)


def direct_search(problem: ContactProblem, stride: float = _LAST_STRIDE) -> ContactFit:
    """Fit by pattern search until no coordinate move of relative size ``stride`` lowers the misfit.

    First on a reduction that spans from a tenth of the guess to a thousand times it, then on one made for the range
    found, which is then exact to far below the noise.
    """
    begun = time.perf_counter()
    measured, whiten = problem.space.coordinates(problem.voltage_v), problem.space.design
    counted = 0

    def cost_on(reduction: ContactReduction) -> Callable[[Array], float]:
        def cost(logs: Array) -> float:
            nonlocal counted
            counted += 1
            residual = measured - whiten @ reduction.pair_resistance_ohm(*problem.split(logs))
            return float(residual @ residual)

        return cost

    ratio = problem.guess_ohm / problem.sheet_resistance_ohm_sq
    wide = cost_on(ContactReduction.of(problem.model, 0.1 * ratio, _REACH * ratio))
    logs = pattern_search(wide, problem.start(), _FIRST_STRIDE, _WIDE_STRIDE)
    contact, sheet = problem.split(logs)
    around = float(contact.min()) / sheet / _NARROW, float(contact.max()) / sheet * _NARROW
    logs = pattern_search(cost_on(ContactReduction.of(problem.model, *around)), logs, 100 * _WIDE_STRIDE, stride)
    pairs, slope = problem.linearised(logs)
    before = problem.reading_rms(problem.linearised(problem.start())[0])
    return _result(problem, logs, pairs, slope, before, "direct_search", counted, begun)


def pattern_search(cost: Callable[[Array], float], start: Array, first_stride: float, last_stride: float) -> Array:
    """Hooke and Jeeves' minimum of ``cost`` from ``start`` (n,): explore each coordinate, then repeat what helped.

    The stride halves when no coordinate move helps and the search ends once it is below ``last_stride``.
    """
    base, lowest = np.array(start, dtype=float), cost(start)
    stride = first_stride
    while stride >= last_stride:
        point, value = _explore(cost, base, lowest, stride)
        if value >= lowest:
            stride /= 2
            continue
        while value < lowest:
            onward = 2 * point - base
            base, lowest = point, value
            point, value = _explore(cost, onward, cost(onward), stride)
    return base


def _explore(cost: Callable[[Array], float], point: Array, value: float, stride: float) -> tuple[Array, float]:
    point = point.copy()
    for coordinate in range(len(point)):
        for sign in (1.0, -1.0):
            trial = point.copy()
            trial[coordinate] += sign * stride
            found = cost(trial)
            if found < value:
                point, value = trial, found
                break
    return point, value


def _noise(problem: ContactProblem, jacobian: Array, residual: Array) -> float:
    """What one coordinate is off by, in volt: its noise, or the residual's rms where the model misses by more.

    Where the noise isn't known it is the solver's rounding at least. Fits to readings that no even sheet gives would
    look for steps below that rounding if only the noise counted.
    """
    scatter = float(np.sqrt(residual @ residual / max(1, jacobian.shape[0] - jacobian.shape[1])))
    least = _SOLVED * float(np.abs(problem.voltage_v).max()) if problem.noise_v is None else problem.noise_v
    return max(scatter, least)


def _result(
    problem: ContactProblem,
    logs: Array,
    pairs: Array,
    slope: Array,
    before: float,
    method: str,
    evaluations: int,
    begun: float,
) -> ContactFit:
    measured, whiten = problem.space.coordinates(problem.voltage_v), problem.space.design
    residual, jacobian = measured - whiten @ pairs, whiten @ slope
    noise = _noise(problem, jacobian, residual)
    values = np.exp(logs)
    by_ohm = jacobian / values
    loose = (noise / (_PRIOR_LOG_SD * np.maximum(values, problem.guess_ohm))) ** 2
    covariance = noise**2 * np.asarray(np.linalg.inv(by_ohm.T @ by_ohm + np.diag(loose)))
    errors = np.sqrt(np.diag(covariance))
    contact, sheet = problem.split(logs)
    freedom = max(1, jacobian.shape[0] - jacobian.shape[1])
    return ContactFit(
        contact,
        errors[: len(contact)],
        sheet,
        float(errors[-1]) if problem.fit_sheet else 0.0,
        covariance,
        noise,
        residual,
        float(np.sqrt(residual @ residual / freedom)),
        before,
        problem.reading_rms(pairs),
        method,
        evaluations,
        time.perf_counter() - begun,
    )
