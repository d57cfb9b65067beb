"""Whether a specimen's presses differ from one another: each may be felt more or less strongly than the others.

Presses at other places of a film, or contacts that are made anew, multiply the stress by a factor of their own. What a
press's own rise tells of that factor is known before the rest of it is predicted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.specimen.logarithmic import LogarithmicTest

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

RISEN = 0.5
"""Part of a press's largest stress up to which its rise counts as known."""
LOADED = 0.05
"""Part of the largest stress from which a reading tells how strongly a press is felt."""
WIDEST = 3.0
"""Largest log factor looked for."""
ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Presses:
    """How strongly each press is felt: ``number`` (C,) of the presses, ``log_factor`` (C,) on their stress.

    ``alike`` and ``apart`` are the relative errors of a static law on what follows the rise of the presses held out,
    with all presses alike and with each its own factor; ``differ``: whether that is most of what a static law misses.
    ``ahead`` (N,) says which readings these are. ``scaled``: the test with the factors on its stress.
    """

    number: NDArray[np.intp]
    log_factor: Array
    alike: float
    apart: float
    differ: bool
    ahead: Rows
    scaled: LogarithmicTest

    @property
    def spread(self) -> float:
        """Rms of the logarithms of the factors, their mean taken off."""
        return float(self.log_factor.std())

    def as_builtins(self) -> dict[str, object]:
        """For ``diagnosis.json``."""
        factors = {int(k): round(float(np.exp(v)), 4) for k, v in zip(self.number, self.log_factor, strict=True)}
        return {"differ": self.differ, "static": self.alike, "static_each_its_own": self.apart, "felt": factors}


def presses(test: LogarithmicTest, press: NDArray[np.intp], criteria: Criteria) -> Presses:
    """The factors of the presses numbered ``press`` (N,), from their rises alone, and what they are worth held out."""
    number = np.unique(press)
    member = press == number[:, None]
    rise = np.array([_rise(test.stress_pa, mine) for mine in member])
    loaded = test.stress_pa > LOADED * test.stress_pa.max()
    fitted = np.array([test.fitted[mine].all() for mine in member])
    log_factor = np.zeros(len(number))
    for _ in range(ROUNDS):
        scaled = _scaled(test, member, log_factor)
        log_factor = log_factor + np.array([_best_log_factor(scaled, rows & loaded) for rows in rise])
        log_factor -= log_factor[fitted].mean()
    scaled = _scaled(test, member, log_factor)
    ahead = ~test.fitted & loaded & ~rise.any(axis=0)
    alike, apart = (float(np.sqrt(np.mean(one.errors(())[ahead] ** 2))) for one in (test, scaled))
    differ = alike**2 - apart**2 > criteria.most_share * alike**2
    return Presses(number, log_factor, alike, apart, differ, ahead, scaled)


def _scaled(test: LogarithmicTest, member: Rows, log_factor: Array) -> LogarithmicTest:
    """The test with each press's factor on its stress, the law's largest pressure as it was."""
    return replace(test, stress_pa=test.stress_pa * np.exp(log_factor @ member), largest_pa=test.reach_pa)


def _rise(stress_pa: Array, mine: Rows) -> Rows:
    """(N,) the readings of a press up to where its stress first passes ``RISEN`` of its largest."""
    rows = np.flatnonzero(mine)
    first = int(np.argmax(stress_pa[rows] > RISEN * stress_pa[rows].max()))
    found = np.zeros(len(stress_pa), dtype=bool)
    found[rows[: first + 1]] = True
    return found


def _best_log_factor(test: LogarithmicTest, rows: Rows) -> float:
    """Log factor that brings the readings ``rows`` (N,) nearest to the law of the presses fitted, all alike."""
    law = test.law(())

    def cost(value: float) -> float:
        return float(np.abs(law(test.stress_pa[rows] * np.exp(value)) - np.log(test.resistance_ohm_sq[rows])).sum())

    return float(minimize_scalar(cost, bounds=(-WIDEST, WIDEST), method="bounded").x) if rows.any() else 0.0
