"""What a simulated skin must be able to do to sit on the virtual bench, and the least that does it."""

from __future__ import annotations

from typing import Protocol as Interface

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances
from ertskin.physics.sensor import Layer, Sensor, four_points_m, rectangle_m, taxel_grid_m

Array = NDArray[np.float64]


class Skin(Interface):
    """A skin under one indenter. Calls come in time order."""

    sensor: Sensor
    protocol: Protocol

    def advance(self, time_s: float, contact_m: Array | None, depth_m: float) -> float:
        """Load cell in newton, the stage now ``depth_m`` deep at ``contact_m`` (2,); None or 0 is in the air."""
        ...

    def lay(self, time_s: float, contact_m: Array | None, force_n: float = 0.0) -> None:
        """Weights of ``force_n`` newton each are laid on (P,2) by hand; with None they are taken off."""
        ...

    def scan(self, time_s: float) -> Array:
        """(K,M) volt of a scan that starts at ``time_s`` with the stage standing still."""
        ...


class SpringSkin:
    """A spring over a coarse grid of resistors: not a model of anything, but passive, reciprocal, and fast.

    For trying instruments and experiments, where the physics does not matter.
    """

    def __init__(self, seed: int = 0, noise_v: float = 0.0, electrodes: int = 8, nodes: int = 7) -> None:
        """``electrodes`` sit around the edge of a grid of ``nodes`` squared."""
        size_m = 0.06
        cell_m = size_m / (nodes - 1)
        rim = np.concatenate([np.arange(nodes), np.arange(2, nodes) * nodes - 1, nodes * nodes - 1 - np.arange(nodes)])
        rim = np.concatenate([rim, nodes * np.arange(nodes - 2, 0, -1)])
        self._at = rim[np.linspace(0, len(rim), electrodes, endpoint=False).astype(int)]
        self._nodes_m = cell_m * np.stack([np.arange(nodes**2) % nodes, np.arange(nodes**2) // nodes], axis=1)
        center = np.clip(self._nodes_m[self._at], 3e-3, size_m - 3e-3)
        self.sensor = Sensor(
            rectangle_m((size_m, size_m)), 1e3, 10.0, center, np.full((electrodes, 2), 4e-3),
            taxel_m=taxel_grid_m((size_m, size_m), 3, 3), layers=(Layer("foam", 4e-3, 28e3, 0.3),),
            indenter_points_m=four_points_m(0.01),
        )  # fmt: skip
        pairs = electrode_pairs(electrodes)
        scan_s = 0.4
        self.protocol = Protocol.against_sink(
            pairs, electrodes, 1e-3, injection_offset_s=scan_s * np.arange(len(pairs)) / len(pairs), scan_s=scan_s,
            adc_volts_per_count=2.0**-13, adc_limit_v=8.0,
        )  # fmt: skip
        right = [(k, k + 1) for k in range(nodes**2) if (k + 1) % nodes]
        self._edges = np.array(right + [(k, k + nodes) for k in range(nodes**2 - nodes)])
        self._rng = np.random.default_rng(seed)
        self._noise_v = noise_v
        self._touch: list[tuple[Array, float]] = []
        self._laid: list[tuple[Array, float]] = []

    def advance(self, time_s: float, contact_m: Array | None, depth_m: float) -> float:
        """2 N/mm."""
        force = 2e3 * depth_m if contact_m is not None and depth_m > 0.0 else 0.0
        self._touch = [(np.asarray(contact_m), force)] if force > 0.0 else []
        return force

    def lay(self, time_s: float, contact_m: Array | None, force_n: float = 0.0) -> None:
        """Weights, or with None none."""
        self._laid = [] if contact_m is None else [(place, force_n) for place in contact_m]

    def scan(self, time_s: float) -> Array:
        """(K,M) volt: a press makes the resistors around it conduct better."""
        weight = np.full(len(self._edges), 1e-3)
        middle = self._nodes_m[self._edges].mean(axis=1)
        for place, force in self._touch + self._laid:
            near = np.exp(-(((middle - place) ** 2).sum(axis=1)) / (2 * 0.008**2))
            weight *= 1.0 + 0.3 * force * near
        laplacian = np.zeros((len(self._nodes_m),) * 2)
        i, j = self._edges.T
        np.add.at(laplacian, (i, j), -weight)
        np.add.at(laplacian, (j, i), -weight)
        np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
        transfer = np.linalg.pinv(laplacian)[np.ix_(self._at, self._at)] + 10.0 * np.eye(len(self._at))
        voltage = self.protocol.readings(pair_resistances(transfer))
        return voltage + self._noise_v * self._rng.normal(size=voltage.shape)
