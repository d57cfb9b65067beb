"""From votes to contacts by the tabulated forward model: the part of ``contacts`` that needs no torch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.models.estimate import Estimate
from ertskin.models.votes import nearest_taxels, together
from ertskin.physics.touch.interplay import Interplay
from ertskin.physics.touch.search import Beliefs, TouchPosterior
from ertskin.physics.touch.table import ResponseTable, TouchGrid

Array = NDArray[np.float64]

TABLE = ("x_m", "y_m", "force_n", "knots_x", "knots_y", "knots_n", "response", "cell_s", "read")
INTERPLAY = ("center_m", "area_m2", "field", "green")
SURE = ("shape_spread", "remainder", "error", "widening")


def proposals(weight: Array, force_n: Array, place_m: Array, spacing_m: float, threshold: float, most: int) -> Array:
    """(N,most,3) x, y and force of the places with the weightiest votes, NaN for none."""
    proposed = np.full((len(weight), most, 3), np.nan)
    for n, vote in enumerate(zip(weight, force_n, place_m, strict=True)):
        found = together(*vote, 0.8 * spacing_m, threshold)[:most]
        proposed[n, : len(found)] = found
    return proposed


def estimate_of(beliefs: Beliefs, taxel_m: Array) -> Estimate:
    """Beliefs as an estimate; the contacts' forces also on the taxels nearest to them."""
    force_map_n = nearest_taxels(beliefs.contact_m, beliefs.force_n, taxel_m)
    return Estimate(
        force_map_n,
        force_map_n > 0,
        beliefs.contact_m,
        beliefs.force_n,
        beliefs.covariance,
        beliefs.probability,
        beliefs.misfit,
    )


def posterior_of(held: dict[str, Any], least_force_n: float, most: int, **settings: Any) -> TouchPosterior:
    """The posterior from the arrays it consists of, by name."""
    interplay = Interplay(*(held[name] for name in INTERPLAY))
    table = ResponseTable(
        grid=TouchGrid(*(held[name] for name in TABLE[:3])),
        interplay=interplay,
        **{name: held[name] for name in TABLE[3:]},
    )
    spread, remainder, error, widening = (held[name] for name in SURE)
    return TouchPosterior(
        table, spread, float(remainder), error, least_force_n, most=most, widening=float(widening), **settings
    )
