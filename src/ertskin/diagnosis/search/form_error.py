"""What the form of an instrument's effect leaves: a nameless part of it, a rival of every further name.

No form is exactly the instrument's: channels of one multiplexer settle each in its own time, say. What is wrong with it
is taken to be a little of every other form in which the instrument may show the same, each as likely as not (a
discrepancy as in Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425, in the span of these forms). A further name
must gain beyond that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.nonreciprocal import instruments
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.search.first_order_gain import (
    add_leftover,
    beyond_networks,
    held_out_gains,
    with_columns,
)
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, Parameter

Array = NDArray[np.float64]

SPREADS = 0.03, 0.1, 0.3
"""Standard deviations tried of how much there is of each other form, over the effect's size."""


@dataclass(frozen=True, eq=False)
class FormError:
    """The error of the instrument's effects in the ``forms`` (r,): ``sizes`` (n+r,) of the steps of the fit's numbers
    beside it and of the forms, and what it gains in half chi-square held out."""

    forms: tuple[AcquisitionEffect, ...] = ()
    sizes: Array | None = None
    gain: float = 0.0

    def expected(self, problem: VoltageProblem, solved: Solved) -> Array:
        """(T,P) what the error makes of the scans of a problem's frames, in units of the noise."""
        if self.sizes is None:
            return np.zeros_like(problem.evidence.scan_v)
        evaluated = problem.solve(solved.terms, solved.calibration, steps=0)
        own = len(self.sizes) - len(self.forms)
        columns = _columns(problem, evaluated, self.forms)
        return np.asarray(problem.last_columns[0] @ self.sizes[:own] + columns @ self.sizes[own:])


def form_error(
    problem: VoltageProblem, solved: Solved, partitions: Sequence[Sequence[int]], effects: Sequence[Effect]
) -> FormError:
    """The error of the likeliest spread, to first order about a fit, of its ``effects``; none where it doesn't gain.

    No cells gain more held out than they change by when fitted: those that a fit predicts wildly, for few others tell
    of it (a spot that one press has met), would gain by whatever moves it.
    """
    forms = _other_forms(problem, effects)
    if not forms:
        return FormError()
    current = problem.at_hand(solved)
    known = with_columns(problem, current, _columns(problem, current, forms), current.scan_residual)
    if problem.last_leftover is not None:
        add_leftover(problem, current, beyond_networks(problem, current, forms), *known)
    found = [FormError()]
    for spread in SPREADS:
        prior = np.concatenate([current.fit.prior.diagonal(), np.full(len(forms), spread**-2)])
        predicted, fitted, sizes = held_out_gains(*known, prior, current.fit.from_prior, partitions)
        found.append(FormError(forms, sizes, float(np.minimum(predicted, np.abs(fitted)).sum())))
    return max(found, key=lambda error: error.gain)


def _other_forms(problem: VoltageProblem, effects: Sequence[Effect]) -> tuple[AcquisitionEffect, ...]:
    """Every form in which the instrument may show the same, each about as large as the first effect of its name."""
    instrument = {effect.name: effect for effect in reversed(instruments(effects))}
    largest_v = problem.acquisition.largest_v
    found = []
    for effect in instrument.values():
        for start in type(effect).reading_starts(problem.evidence.sensor, problem.evidence.protocol):
            if start.reciprocal:
                continue
            size = {
                key: _rounded(effect.size(key) or start.effect.value(key), effect.parameters()[key])
                for key in start.along
            }
            found.append(cast(AcquisitionEffect, start.effect.changed(size)).scaled_to(largest_v))
    return tuple(found)


def _rounded(size: float, known: Parameter) -> float:
    """To a power of two within what may be: what a form does to scans is remembered from fit to fit, and its spread is
    tried in steps of three."""
    return float(np.clip(2.0 ** np.round(np.log2(size)), known.low, known.high)) if size > 0 else size


def _columns(problem: VoltageProblem, solved: Solved, forms: Sequence[AcquisitionEffect]) -> Array:
    """(T,P,r) what effects of the instrument add to the scans, in units of the noise."""
    scans = problem.linear.scans(problem.family.skin(solved.calibration, solved.effects))
    found = np.zeros((*scans.shape, len(forms)))
    for k, form in enumerate(forms):
        found[..., k] = problem.acquisition.distorted(scans, (form,)) - scans
    moved = np.where(problem.weight[:, None, None] > 0, found / problem.evidence.noise_v, 0.0)
    return problem.evidence.discounted(moved)
