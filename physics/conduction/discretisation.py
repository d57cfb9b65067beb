"""Discretisation error of a sheet model as a number, by refinement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """How far a sheet model is from the same model on a finer mesh.

    ``pair_resistance_ohm`` (P,): coarse minus refined; ``reading_v``: rms over the protocol's readings;
    ``reciprocal_v``: rms over the whitened coordinates of the pair resistances, to be held against the same noise.
    """

    pair_resistance_ohm: Array
    reading_v: float
    reciprocal_v: float


def discretisation_error(
    model: SheetModel,
    conductivity_s: Callable[[Array], Array],
    contact_resistance_ohm: Array,
    protocol: Protocol,
    refined: SheetModel | None = None,
) -> DiscretisationError:
    """Error for a conductivity in siemens given as a function of positions (...,2), against the mesh cut in four.

    ``refined``: another model to compare with, so that several conductivities share one.
    """
    fine = model.refined() if refined is None else refined
    pairs = [m.solve(conductivity_s(m.quadrature_m), contact_resistance_ohm).pair_resistance_ohm for m in (model, fine)]
    error = pairs[0] - pairs[1]
    return DiscretisationError(error, _rms(protocol.readings(error)), _rms(protocol.whitened(error)))


def _rms(value: Array) -> float:
    return float(np.sqrt(np.mean(value**2)))
