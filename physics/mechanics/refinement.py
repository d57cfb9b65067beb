"""How far the bricks' interface pressure is from converged, as a number (part of the noise budget)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.sensor import Sensor

_LINES = 81


@dataclass(frozen=True)
class Refinement:
    """Largest error of the indenter's interface pressure on the finest bricks, as a fraction of the largest pressure.

    ``estimated`` comes from the bricks alone (Richardson, with the ``order`` seen over the last three spacings),
    ``against_exact`` from the transform solution; ``spacing_m`` are the spacings and ``change`` the largest change from
    each to the next.
    """

    spacing_m: tuple[float, ...]
    change: tuple[float, ...]
    order: float
    estimated: float
    against_exact: float


def refine_bricks(sensor: Sensor, spacing_m: Sequence[float]) -> Refinement:
    """Solve on three or more spacings falling by one ratio; raises ``ValueError`` otherwise."""
    spacings = np.asarray(spacing_m, dtype=float)
    ratios = spacings[:-1] / spacings[1:]
    if len(spacings) < 3 or not np.allclose(ratios, ratios[0], rtol=1e-6) or ratios[0] <= 1:
        raise ValueError("refinement needs at least three spacings falling by one ratio")
    reach = 3 * sensor.indenter_diameter_m
    line = np.linspace(-reach, reach, _LINES)
    points = np.stack(np.meshgrid(line, line), axis=-1)
    exact = InterfacePressure.from_transform(sensor).at(points)
    largest = float(np.abs(exact).max())
    fields = [InterfacePressure.from_bricks(sensor, float(spacing)).at(points) for spacing in spacings]
    change = [float(np.abs(b - a).max()) / largest for a, b in pairwise(fields)]
    order = float(np.log(change[-2] / change[-1]) / np.log(ratios[0]))
    gain = ratios[0] ** order - 1
    return Refinement(
        tuple(float(s) for s in spacings),
        tuple(change),
        order,
        float(change[-1] / gain) if gain > 0 else float("inf"),
        float(np.abs(fields[-1] - exact).max()) / largest,
    )
