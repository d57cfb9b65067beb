"""The sheets benchmarked: a round tank for single frames, the paper's padded sheet for trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ertskin.physics.conduction.mesh import Grading, SheetMesh, mesh_sheet
from ertskin.physics.sensor import Sensor, rectangle_m

RADIUS_M = 0.1
CELL_M = {2_500: 3.8e-3, 10_000: 1.8e-3, 40_000: 9.0e-4}


def tank_mesh(cell_m: float, electrodes: int = 24) -> SheetMesh:
    """Even triangles in a disk; electrodes over half its rim."""
    corners = electrodes * 2 * max(1, round(np.pi * RADIUS_M / electrodes / cell_m))
    angle = 2 * np.pi * np.arange(corners) / corners
    outline = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    step = corners // electrodes
    first = step * np.arange(electrodes)
    edge = np.stack([outline[first], outline[(first + step // 2) % corners]], axis=1)
    return mesh_sheet(Sensor(outline, 1.0, 1.0, electrode_edge_m=edge), Grading(cell_m, cell_m))


def middle_nodes(mesh: SheetMesh) -> np.ndarray:
    """One node in the middle of each electrode, for solvers that know points only."""
    return np.array([edge[len(edge) // 2, 0] for edge in mesh.edge])


def random_conductivity(mesh: SheetMesh, points: int, seed: int) -> np.ndarray:
    """(E,Q) siemens over one decade, a new one for every seed."""
    return np.repeat(10 ** np.random.default_rng(seed).uniform(-0.5, 0.5, (len(mesh.triangle), 1)), points, axis=1)


def padded_sheet() -> Sensor:
    """24 pads of 4 mm, 20 round the rim and 4 inside, on 120 mm of 18 kohm/sq; 36 sensing points."""
    line = np.linspace(0.005, 0.115, 6)
    low, high = np.full(5, line[0]), np.full(5, line[-1])
    rim = [(line[:-1], low), (high, line[:-1]), (line[:0:-1], high), (low, line[:0:-1])]
    inner = np.array([[0.04, 0.04], [0.08, 0.04], [0.04, 0.08], [0.08, 0.08]])
    center = np.concatenate([*(np.stack(side, axis=1) for side in rim), inner])
    taxel = np.stack(np.meshgrid(*[np.arange(6) * 0.02 + 0.01] * 2), axis=-1).reshape(-1, 2)
    return Sensor(rectangle_m((0.12, 0.12)), 18_000.0, 10.0, center, np.full((24, 2), 0.004), taxel_m=taxel)


@dataclass(frozen=True)
class IndenterPressure:
    """A pressure like the paper's pad under a 10 mm indenter: 16 kPa per newton in the middle, a long weak tail."""

    width_m: float = 3.2e-3

    def at(self, offset_m: np.ndarray) -> np.ndarray:
        """(...,) Pa/N."""
        square = (np.asarray(offset_m) ** 2).sum(axis=-1)
        return 1.58e4 * np.exp(-square / (2 * self.width_m**2)) + 60.0 * np.exp(-np.sqrt(square + 1e-6) / 9e-3)

    def radius_m(self, fraction: float) -> float:
        """Distance beyond which the pressure stays below a fraction of its largest value."""
        radius = np.linspace(0, 0.2, 20_000)
        value = self.at(np.stack([radius, np.zeros_like(radius)], axis=-1))
        return float(radius[np.flatnonzero(value > fraction * value[0])[-1]])


class SaturatingLaw:
    """A sheet resistance that falls from 18 kohm/sq to a quarter at 60 kPa and stays."""

    def sheet_resistance_ohm_sq(self, pressure_pa: np.ndarray) -> np.ndarray:
        """(...,) ohm per square."""
        return 18_000.0 * (0.225 + 0.775 * (1 - np.clip(np.asarray(pressure_pa) / 6e4, 0, 1)) ** 3)
