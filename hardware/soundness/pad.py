"""The layers above and below the interface, the taxels and the indenter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ertskin.hardware.plausibility import Doubt
from ertskin.physics.sensor import Sensor

MOST_LAYERS = 50
MOST_TAXELS = 10_000
THINNEST_M, THICKEST_M = 1e-6, 0.2
SOFTEST_PA, STIFFEST_PA = 100.0, 1e12
LEAST_POISSON, MOST_POISSON = -0.9, 0.4999
MOST_MARGIN = 10.0
"""Of the sheet's longer side: how far the pad may reach beyond the sheet."""


def pad_faults(sensor: Sensor) -> Iterator[Doubt]:
    """What is wrong with the layers, the margin, the taxels and the indenter's points."""
    yield from _layer_faults(sensor)
    low, high = sensor.extent_m
    longer = float(np.max(high - low))
    if not 0.0 <= sensor.pad_margin_m <= MOST_MARGIN * longer:
        expected = f"0 to {MOST_MARGIN * longer:g} m, {MOST_MARGIN:g} times the sheet"
        yield Doubt("/sensor/pad_margin_m", f"{sensor.pad_margin_m:g} m", expected)
    taxel = sensor.taxel_m
    if len(taxel) > MOST_TAXELS:
        yield Doubt("/sensor/taxel_m", f"{len(taxel)} taxels", f"{MOST_TAXELS} at most")
    outside = np.flatnonzero(((taxel < low) | (taxel > high)).any(axis=1))
    if len(outside):
        yield Doubt("/sensor/taxel_m", f"taxel {outside[0]} outside the sheet", "taxels on the sheet")
    if len(np.unique(taxel, axis=0)) < len(taxel):
        yield Doubt("/sensor/taxel_m", "two taxels at one place", "taxels apart")
    if len(sensor.indenter_points_m) and np.abs(sensor.indenter_points_m).max() > longer:
        yield Doubt("/sensor/indenter_points_m", "an indenter larger than the sheet", "one that fits on it")


def _layer_faults(sensor: Sensor) -> Iterator[Doubt]:
    names = [layer.name for layer in sensor.layers]
    if len(set(names)) < len(names):
        yield Doubt("/sensor/layers", "two layers of one name", "a name for each")
    for k, layer in enumerate(sensor.layers):
        for name, value, low, high, unit in (
            ("thickness_m", layer.thickness_m, THINNEST_M, THICKEST_M, " m"),
            ("youngs_modulus_pa", layer.youngs_modulus_pa, SOFTEST_PA, STIFFEST_PA, " Pa"),
            ("poissons_ratio", layer.poissons_ratio, LEAST_POISSON, MOST_POISSON, ""),
        ):
            if not low <= value <= high:
                yield Doubt(f"/sensor/layers[{k}] {name}", f"{value:g}{unit}", f"{low:g} to {high:g}{unit}")
