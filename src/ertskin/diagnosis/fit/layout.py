"""The vector of a fit's numbers: which means what, its bounds and its prior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.fit.bounded_step import Inequalities
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import CONTACT_SPREAD, SHAPE, WIDEST_RATIO, Calibration, law_factors
from ertskin.physics.effects.effect import AcquisitionEffect, ElectrodeEffect, Stage, shown_by
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.piezo.polynomial import PiezoPolynomial

Array = NDArray[np.float64]

LEAST_OHM, MOST_OHM = 1e-2, 1e9
"""Between which a sheet's and a contact's resistance are looked for at most."""
RATIO_PRIOR = 1.0
SHAPE_PRIOR = 0.3
HIGHER_PRIOR = 0.02
"""The law's coefficients above the fifth, which the paper's polynomial hasn't."""
STAYING = 0.5
"""Part of the least that a contact which wanders far has at rest, that it keeps while it is fitted."""
FARTHEST_CONTACT = 4.0
"""Of the logarithm of a contact resistance, from the one at rest and from most of those."""


@dataclass(frozen=True)
class Layout:
    """Which number of the vector means what."""

    terms: tuple[Term, ...]
    calibration: int

    @property
    def ratio(self) -> int:
        """Which number is the logarithm of the moduli's ratio."""
        return self.calibration - SHAPE - 1

    def split(self, x: Array) -> tuple[Calibration, tuple[Term, ...]]:
        terms = [term.at(x[k : k + term.count].tolist()) for term, k in zip(self.terms, self._first, strict=True)]
        return Calibration.of(x[: self.calibration]), tuple(terms)

    @cached_property
    def _first(self) -> list[int]:
        """Each term's first number."""
        return [self.calibration + sum(t.count for t in self.terms[:k]) for k in range(len(self.terms))]

    @cached_property
    def _named(self) -> dict[int, tuple[Term, str]]:
        """The terms' parameters by their number."""
        return {
            first + k: (term, key)
            for term, first in zip(self.terms, self._first, strict=True)
            for k, key in enumerate(term.free)
        }

    @property
    def parameters(self) -> list[int]:
        """The numbers that are parameters of effects; those of the instrument first, while a network that they leave as
        it is is remembered."""
        return sorted(self._named, key=lambda k: not self.is_instrument(k))

    @property
    def fields(self) -> list[tuple[int, slice]]:
        """Terms with a field in modes, by their place in the list, and which numbers are the modes' sizes."""
        return [
            (k, slice(first + len(term.free), first + term.count))
            for k, (term, first) in enumerate(zip(self.terms, self._first, strict=True))
            if term.modes is not None
        ]

    def is_instrument(self, index: int) -> bool:
        """Whether the number belongs to an effect that no resistor network explains."""
        return index in self._named and shown_by(self._named[index][0].effect, Signal.NONRECIPROCAL)

    def step(self, index: int, x: Array) -> float:
        """Finite-difference step, away from the upper bound."""
        if index < self.calibration:
            return 1e-3
        term, key = self._named[index]
        known = term.effect.known(key)
        size = 0.02 * known.typical
        return size if x[index] + size <= known.high else -size

    def moved(self, index: int, x: Array) -> Array:
        """The numbers with one moved by its step."""
        moved = x.copy()
        moved[index] += self.step(index, x)
        return moved

    def on_readings_alone(self, index: int) -> bool:
        """Whether the number belongs to an effect that leaves the network as it is."""
        effect = self._named[index][0].effect if index in self._named else None
        return effect is not None and effect.stage == Stage.ACQUISITION and isinstance(effect, AcquisitionEffect)

    def bounds(self, contact_ohm: Array, widest_ratio: float = WIDEST_RATIO) -> tuple[Array, Array]:
        """Lowest and highest numbers (n,); contacts stay near those at rest ``contact_ohm`` (L,) and most of these, the
        logarithm of the moduli's ratio within ``widest_ratio`` of nought.

        Readings that leave driven electrodes out hardly tell a contact: a misfit would take it to where the skin, as
        linearised, is another one, or to where nothing is left of one that wanders.
        """
        count = self.calibration + sum(t.count for t in self.terms)
        low, high = np.full(count, -np.inf), np.full(count, np.inf)
        contacts, rested = slice(1, self.ratio), np.log(contact_ohm)
        low[: self.ratio], high[: self.ratio] = np.log(LEAST_OHM), np.log(MOST_OHM)
        low[contacts] = np.maximum(low[contacts], np.minimum(rested, np.median(rested)) - FARTHEST_CONTACT)
        taken = self._most_taken_ohm(len(contact_ohm))
        least = taken + STAYING * np.clip(contact_ohm - taken, 0.0, taken)
        low[contacts] = np.maximum(low[contacts], np.log(np.maximum(least, LEAST_OHM)))
        high[contacts] = np.minimum(high[contacts], np.maximum(rested, np.median(rested)) + FARTHEST_CONTACT)
        low[self.ratio], high[self.ratio] = -widest_ratio, widest_ratio
        for k, (term, key) in self._named.items():
            known = term.effect.known(key)
            low[k], high[k] = known.low, known.high
        return low, high

    def _most_taken_ohm(self, electrodes: int) -> Array:
        """(L,) ohm that the terms take off each contact at most."""
        wandering = (t.effect for t in self.terms if isinstance(t.effect, ElectrodeEffect))
        return np.sum([np.zeros(electrodes), *(effect.most_taken_ohm(electrodes) for effect in wandering)], axis=0)

    def law_above(self, law: PiezoPolynomial, least: float) -> Inequalities:
        """What keeps the law above this part of its value unpressed, under any pressure, as its shape moves."""
        known, by_shape = law_factors(law)
        rows = np.zeros((len(known), self.calibration + sum(t.count for t in self.terms)))
        rows[:, self.ratio + 1 : self.calibration] = by_shape
        return Inequalities(rows, least - known)

    def prior(self, contact_ohm: Array) -> tuple[Array, Array]:
        """Mean and precision (n,) of the numbers; contacts are like most of those at rest ``contact_ohm`` (L,)."""
        electrodes = len(contact_ohm)
        count = self.calibration + sum(t.count for t in self.terms)
        mean, precision = np.zeros(count), np.zeros(count)
        mean[1 : self.ratio] = np.median(np.log(contact_ohm))
        precision[1 : self.ratio] = CONTACT_SPREAD**-2
        for _, where in self.fields:
            precision[where] = 1.0
        precision[1 + electrodes] = RATIO_PRIOR**-2
        precision[2 + electrodes : self.calibration] = SHAPE_PRIOR**-2
        precision[7 + electrodes : self.calibration] = HIGHER_PRIOR**-2
        return mean, precision


def halfway(one: Solved, other: Solved) -> Solved:
    """Between two fits of the same terms: their numbers' means, the rest as in the ``other``."""
    middle = 0.5 * (one.fit.value + other.fit.value)
    calibration, terms = Layout(other.terms, len(other.calibration.vector())).split(middle)
    return replace(other, calibration=calibration, terms=terms, fit=replace(other.fit, value=middle))
