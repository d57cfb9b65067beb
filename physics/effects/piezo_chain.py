"""The fabric under pressure: what its effects, one after another, make of the law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import Array, Effect, PiezoEffect
from ertskin.physics.piezo.polynomial import PiezoPolynomial

LEAST_RELATIVE = 1e-6
"""Of a law over its value at rest, the least that is raised to a power: a fit may lead a law astray, through nought."""


def in_fabric(effects: Sequence[Effect]) -> list[PiezoEffect]:
    """What effects do to the fabric, in the order in which it happens."""
    chain = [part for part in (effect.in_fabric() for effect in effects) if part is not None]
    return sorted(chain, key=lambda part: part.order)


def felt(
    effects: Sequence[Effect],
    pressure_pa: Array,
    position_m: Array,
    time_s: Array,
    extent_m: Array,
    wanted: NDArray[np.intp] | None = None,
) -> tuple[Array, Array]:
    """(n,N) pressure in pascal that the law answers to and (n,N) or (1,1) factor on its resistance.

    At the ``wanted`` times (n,), all T by default, from ``pressure_pa`` (T,N) in recording order at points (N,2) over
    times (T,); ``extent_m`` (2,2) the sheet's box.
    """
    factor = np.ones((1, 1))
    for effect in in_fabric(effects):
        factor = factor * effect.resistance_factor(pressure_pa, position_m, time_s, extent_m, wanted)
        pressure_pa = effect.effective_pressure_pa(pressure_pa, position_m, time_s, extent_m)
    return pressure_pa if wanted is None else pressure_pa[wanted], factor


def fabric_ohm_sq(
    law: PiezoPolynomial,
    effects: Sequence[Effect],
    pressure_pa: Array,
    position_m: Array,
    time_s: Array,
    extent_m: Array,
    wanted: NDArray[np.intp] | None = None,
) -> Array:
    """(n,N) ohm per square at the ``wanted`` times (n,), all T by default; arguments as of ``felt``."""
    pressure_pa, factor = felt(effects, pressure_pa, position_m, time_s, extent_m, wanted)
    power = response_power(effects, position_m, extent_m)
    answered = law.sheet_resistance_ohm_sq(pressure_pa)
    if power is not None:
        answered = law.zero_ohm_sq * np.maximum(answered / law.zero_ohm_sq, LEAST_RELATIVE) ** power
    return np.asarray(factor * answered)


def response_power(effects: Sequence[Effect], position_m: Array, extent_m: Array) -> Array | None:
    """(N,) power to which all effects together raise the law's resistance over that at rest; None for 1."""
    powers = (effect.response_power(position_m, extent_m) for effect in in_fabric(effects))
    raised = [power for power in powers if power is not None]
    return np.prod(raised, axis=0) if raised else None
