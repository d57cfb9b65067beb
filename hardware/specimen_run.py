"""The specimen test on the bench itself: a piece of the piezoresistive pair under a plate (paper II-C).

The stage presses the plate in even steps of depth, up and down, and the specimen's resistance is read through one of
the reader's injections, its two ends being wired to that injection's electrodes instead of the skin's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ertskin.hardware.failure import LimitExceeded
from ertskin.hardware.indenter import Indenter
from ertskin.hardware.recording import Specimen
from ertskin.hardware.samples import mean_force_n

COARSE_M = 1e-4
DEEPEST_M = 5e-3


@dataclass(frozen=True)
class SpecimenSetup:
    """How the specimen is mounted and how it is pressed.

    ``reading``: injection and column its resistance shows in; ``squares``: its length over its width.
    """

    area_m2: float
    reading: tuple[int, int] = (0, 0)
    squares: float = 1.0
    stress_pa: float = 6e4
    steps: int = 30
    cycles: int = 5


def press_specimen(indenter: Indenter, setup: SpecimenSetup) -> Specimen:
    """Cycles up to ``stress_pa`` and back, one row a step; the indenter goes up again whatever happens.

    Raises ``LimitExceeded`` where the bench has no specimen, or the stress is not reached within 5 mm or the force
    limit.
    """
    rig = indenter.rig
    if rig.geometry.specimen_m is None:
        raise LimitExceeded("specimen: the bench's geometry names none (specimen_m)")
    x, y, z = rig.geometry.specimen_m
    limits = rig.limits
    with indenter.pressing(x, y, z):
        indenter.check_zero()
        indenter.go(x, y, z + limits.approach_m, limits.travel_speed_m_s)
        surface = indenter.touch_off(x, y, z + limits.approach_m)
        deepest = _depth_of_stress(indenter, x, y, surface, setup)
        rows = []
        ramp = np.linspace(0.0, deepest, setup.steps + 1)
        begin_s = rig.clock.now()
        for cycle in range(setup.cycles):
            for depth in np.concatenate([ramp, ramp[-2::-1]]):
                indenter.go(x, y, surface - float(depth), limits.touch_speed_m_s)
                rows.append((*_row(indenter, setup, begin_s), cycle))
    time_s, stress, resistance, cycles = (np.array(column) for column in zip(*rows, strict=True))
    return Specimen(np.maximum(stress, 0.0), resistance, time_s, cycles.astype(np.int64))


def _depth_of_stress(indenter: Indenter, x: float, y: float, surface_m: float, setup: SpecimenSetup) -> float:
    """The depth at which the stress is reached: felt for in coarse steps, then drawn through the last two."""
    felt = [(0.0, 0.0)]
    while felt[-1][1] < setup.stress_pa:
        depth = felt[-1][0] + COARSE_M
        if depth > DEEPEST_M:
            raise LimitExceeded(f"specimen: {setup.stress_pa:g} Pa not reached within {1e3 * DEEPEST_M:g} mm")
        indenter.go(x, y, surface_m - depth, indenter.rig.limits.touch_speed_m_s)
        begin = indenter.rig.clock.now()
        indenter.listen(0.35)
        force = mean_force_n(list(indenter.samples), begin, indenter.rig.clock.now())
        felt.append((depth, max(felt[-1][1], force / setup.area_m2)))
    (low, below), (high, above) = felt[-2:]
    return low + (high - low) * (setup.stress_pa - below) / (above - below)


def _row(indenter: Indenter, setup: SpecimenSetup, begin_s: float) -> tuple[float, float, float]:
    """Time, stress and sheet resistance now."""
    rig = indenter.rig
    scan_s = rig.protocol.scan_s or 0.0
    rig.reader.start()
    indenter.listen(scan_s)
    scan = rig.reader.finish(scan_s + 4.0)
    force = mean_force_n(list(indenter.samples), scan.time_s, scan.time_s + scan_s)
    injection, reading = setup.reading
    current = float(np.abs(rig.protocol.injection_current_a[injection]).max())
    resistance = float(scan.voltage_v[injection, reading]) / current / setup.squares
    return scan.time_s - begin_s, force / setup.area_m2, resistance
