"""The bench in real time: move the stage, ask for force and scans, as instruments behind ports would."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ertskin.hardware.virtual.bench.acquisition import Electronics
from ertskin.hardware.virtual.bench.indenter import Stage, interpolation
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.hardware.virtual.bench.repeatability import Repeatability
from ertskin.hardware.virtual.bench.skin import FINE, BenchSkin, Resolution
from ertskin.hardware.virtual.bench.truth import Truth
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]


class LiveSkin:
    """One skin under one indenter, answering as time goes on; calls must come in time order.

    ``advance`` moves the stage (one straight, even move since the call before) and returns the load cell's reading,
    ``lay`` puts weights on or takes them off, ``scan`` is what the ERT reader would send for a scan that starts then.
    """

    def __init__(
        self,
        truth: Truth,
        sensor: Sensor | None = None,
        protocol: Protocol | None = None,
        resolution: Resolution = FINE,
        purpose: str = "live",
    ) -> None:
        """``purpose``: runs of one skin for different purposes have noise and presses of their own."""
        self.sensor = sensor or nominal_sensor()
        self.protocol = protocol or nominal_protocol(self.sensor)
        self._limits = threadpool_limits(1)
        self._skin = BenchSkin(self.sensor, truth, resolution)
        self._electronics = Electronics(self.protocol, truth, 0.0, purpose)
        self._noise_n, self._rng = truth.noise.force_n, truth.rng(f"load cell {purpose}")
        self._skewed = truth.parameters("scan_skew") is not None
        self._silent = self._held = np.zeros(self._skin.sheet.points_m.shape[:2])
        rest = self._electronics.potentials_read(self._skin.transfer_ohm(self._silent, 0.0))
        self._electronics.top_v = float(rest.max())
        self._stage = Stage(truth, self._skin.stiffness_n_per_m)
        self._repeatability = Repeatability(truth, purpose)
        self._felt_s = 0.0
        self._laid_m, self._laid_n = np.zeros((0, 2)), 0.0

    def advance(self, time_s: float, contact_m: Array | None, depth_m: float) -> float:
        """Load cell in newton, the stage now ``depth_m`` deep at ``contact_m`` (2,); none or less is in the air."""
        in_air = self._stage.place_m is None
        force = self._stage.move(time_s, contact_m, depth_m)
        if in_air != (self._stage.place_m is None):
            self._come_or_go(time_s, in_air)
        return force + float(self._rng.normal(0.0, self._noise_n))

    def lay(self, time_s: float, contact_m: Array | None, force_n: float = 0.0) -> None:
        """Lay weights of ``force_n`` newton on (P,2), as exactly as a hand does; None takes them off."""
        self._come_or_go(time_s, contact_m is not None)
        places = np.zeros((0, 2)) if contact_m is None else self._skin.landing_m(contact_m)
        self._laid_m, self._laid_n = self._repeatability.placed_m(places), force_n

    def scan(self, time_s: float) -> Array:
        """(K,M) volt of the scan that starts at ``time_s``, the stage's command standing still."""
        scan_s = self.protocol.scan_s or 0.0
        middle = time_s + scan_s / 2
        sampled = np.linspace(0.0, max(scan_s, 1e-3), 9 if self._skewed else 3)
        forces = self._stage.foreseen(time_s, sampled)
        self._stage.stand()
        if not self._skewed or abs(forces[-1] - forces[0]) < 1e-6:
            mean = float(np.trapezoid(forces, sampled) / sampled[-1])
            return self._electronics.scan(self._read(mean, middle), time_s)
        course = np.interp(self._electronics.offset_s, sampled, forces)
        nodes = np.linspace(forces[0], forces[-1], 3)
        readings = np.stack([self._read(node, middle) for node in nodes])
        share = interpolation(nodes, course)
        return self._electronics.scan(np.einsum("kn,nkm->km", share, readings), time_s)

    def _read(self, force_n: float, time_s: float) -> Array:
        place = self._stage.place_m
        pressure = self._silent
        if len(self._laid_m):
            felt = np.full(len(self._laid_m), self._laid_n * self._repeatability.gain)
            pressure = self._skin.pressure_pa(self._laid_m, felt)
        elif place is not None and force_n > 0.0:
            landing = self._repeatability.landed_m(self._skin.landing_m(place)[None])
            felt = np.array([force_n * self._repeatability.gain])
            pressure = self._skin.pressure_pa(landing, felt, self._stage.stiffened)
        self._rest_on(pressure, time_s)
        transfer = self._skin.transfer_ohm(pressure, time_s, self._repeatability.scanned_ohm())
        return self._electronics.potentials_read(transfer)

    def _come_or_go(self, time_s: float, comes: bool) -> None:
        """What pressed until now, or nothing, is over."""
        self._rest_on(self._held, time_s)
        if comes:
            self._repeatability.next_press()
        else:
            self._rest_on(self._silent, time_s)

    def _rest_on(self, pressure_pa: Array, until_s: float) -> None:
        self._skin.dwell(pressure_pa, max(until_s - self._felt_s, 0.0))
        self._felt_s = max(until_s, self._felt_s)
        self._held = pressure_pa
