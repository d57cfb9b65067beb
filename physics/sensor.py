"""The sensor: its sheet, electrodes, layers and sensing points. SI units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Layer:
    """One homogeneous, isotropic layer of the pad (paper II-B, Table I)."""

    name: str
    thickness_m: float
    youngs_modulus_pa: float
    poissons_ratio: float


def _no_points() -> Array:
    return np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class Sensor:
    """A resistive sheet with electrodes under a layered pad.

    ``outline_m`` (N,2) is a closed counter-clockwise polygon. Electrodes are either square pads inside the sheet
    (``electrode_center_m``, ``electrode_size_m``, both (L,2)) or stretches of the outline (``electrode_edge_m``
    (L,2,2): first and last point, counter-clockwise). ``layers`` run from the top down, the last one glued to a rigid
    plate; the piezoresistive interface lies under layer number ``piezo_interface``.
    """

    outline_m: Array
    sheet_resistance_ohm_sq: float = 1.0
    contact_resistance_guess_ohm: float = 10.0
    electrode_center_m: Array = field(default_factory=_no_points)
    electrode_size_m: Array = field(default_factory=_no_points)
    electrode_edge_m: Array | None = None
    taxel_m: Array = field(default_factory=_no_points)
    layers: tuple[Layer, ...] = ()
    piezo_interface: int = 0
    indenter_diameter_m: float = 0.01
    indenter_points_m: Array = field(default_factory=_no_points)
    pad_margin_m: float = 0.0

    @property
    def electrode_middle_m(self) -> Array:
        """(L,2) the electrodes' middles."""
        return self.electrode_center_m if self.electrode_edge_m is None else self.electrode_edge_m.mean(axis=1)

    def electrodes_as(self, other: Sensor) -> bool:
        """Whether all electrodes lie where those of the ``other`` sensor do."""
        return np.array_equal(self.electrode_middle_m, other.electrode_middle_m)

    @property
    def electrodes(self) -> int:
        """Number of electrodes L."""
        return len(self.electrode_center_m) if self.electrode_edge_m is None else len(self.electrode_edge_m)

    @property
    def extent_m(self) -> Array:
        """(2,2) lower-left and upper-right corner of the sheet's bounding box."""
        return np.array([self.outline_m.min(axis=0), self.outline_m.max(axis=0)])

    def with_layers(self, **youngs_modulus_pa: float) -> Sensor:
        """The same sensor with new moduli for the layers named; an unknown name raises ``KeyError``."""
        unknown = set(youngs_modulus_pa) - {layer.name for layer in self.layers}
        if unknown:
            raise KeyError(f"no layer named {sorted(unknown)}; the pad has {[layer.name for layer in self.layers]}")
        layers = tuple(
            replace(layer, youngs_modulus_pa=youngs_modulus_pa.get(layer.name, layer.youngs_modulus_pa))
            for layer in self.layers
        )
        return replace(self, layers=layers)


def rectangle_m(size_m: tuple[float, float] | Array) -> Array:
    """(4,2) outline of the sheet [0,Lx]x[0,Ly], counter-clockwise."""
    lx, ly = float(size_m[0]), float(size_m[1])
    return np.array([[0.0, 0.0], [lx, 0.0], [lx, ly], [0.0, ly]])


def disk_m(radius_m: float, points: int = 128) -> Array:
    """(points,2) outline of a round sheet that fills [0,2R]x[0,2R], counter-clockwise from its rightmost point."""
    angle = 2 * np.pi * np.arange(points) / points
    return radius_m * (1.0 + np.stack([np.cos(angle), np.sin(angle)], axis=1))


def edge_electrodes_m(
    outline_m: Array, count: int, width_m: float, first_m: float = 0.0, clockwise: bool = False
) -> Array:
    """(count,2,2) first and last points of electrodes spread evenly along an outline (N,2), each ``width_m`` wide.

    The first one's middle lies ``first_m`` along the outline, counter-clockwise from its first point; the others
    follow, ``clockwise`` or not. Raises ``ValueError`` where they would overlap.
    """
    closed = np.vstack([outline_m, outline_m[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    if not 0 < width_m < arc[-1] / count:
        raise ValueError(f"{count} electrodes of {width_m:g} m don't fit on an outline of {arc[-1]:g} m")
    middle = first_m + (-1 if clockwise else 1) * arc[-1] / count * np.arange(count)
    ends = np.mod(np.stack([middle - 0.5 * width_m, middle + 0.5 * width_m], axis=1), arc[-1])
    return np.stack([np.interp(ends, arc, closed[:, k]) for k in range(2)], axis=-1)


def four_points_m(diameter_m: float) -> Array:
    """(4,2) the paper's cylindrical indenter: four point forces at half its radius (II-B)."""
    return 0.25 * diameter_m * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


def taxel_grid_m(size_m: tuple[float, float] | Array, columns: int, rows: int) -> Array:
    """(columns*rows, 2) centres of a uniform grid of sensing points, x fastest."""
    x = (np.arange(columns) + 0.5) * float(size_m[0]) / columns
    y = (np.arange(rows) + 0.5) * float(size_m[1]) / rows
    return np.stack([np.tile(x, rows), np.repeat(y, columns)], axis=1)
