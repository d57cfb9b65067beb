"""The bench: a skin, an indenter and electronics run through a plan, and written down as a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ertskin.hardware.recording import Frames, Recording, RigidBlock, Specimen
from ertskin.hardware.virtual.bench.acquisition import Electronics
from ertskin.hardware.virtual.bench.indenter import MOVE_S, Stage, interpolation
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.hardware.virtual.bench.piezo import ClosingLaw, LogCreep, WedgeMemory
from ertskin.hardware.virtual.bench.plans import PLANS
from ertskin.hardware.virtual.bench.repeatability import Repeatability
from ertskin.hardware.virtual.bench.skin import FINE, BenchSkin, Resolution
from ertskin.hardware.virtual.bench.truth import Truth
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

CREATED = "2026-01-01T00:00:00Z"


class Bench:
    """One simulated skin on one simulated rig; what is hidden in it stands in ``truth``."""

    def __init__(
        self,
        truth: Truth,
        sensor: Sensor | None = None,
        protocol: Protocol | None = None,
        resolution: Resolution = FINE,
    ) -> None:
        self.truth = truth
        self.sensor = sensor or nominal_sensor()
        self.protocol = protocol or nominal_protocol(self.sensor)
        self.resolution = resolution

    def recording(self, plan: str, progress: Callable[[int, int], None] | None = None) -> Recording:
        """The plan of that name (``PLANS``) run through; raises ``KeyError`` for an unknown one."""
        history = PLANS[plan](self.sensor)
        frames = self.frames(history, plan, progress)
        rig = f"bench_{self.truth.seed}"
        return Recording(rig, CREATED, plan, self.sensor, self.protocol, frames, self.specimen(), self.rigid_block())

    def frames(
        self, history: History, purpose: str, progress: Callable[[int, int], None] | None = None, ideal: bool = False
    ) -> Frames:
        """The scans of a commanded history, with the load cell's forces; ``ideal`` leaves out every random error."""
        with threadpool_limits(1):
            return self._frames(history, purpose, progress, ideal)

    def _frames(
        self, history: History, purpose: str, progress: Callable[[int, int], None] | None, ideal: bool
    ) -> Frames:
        run = _Run(self, purpose)
        voltage = np.empty((len(history), *self.protocol.shape), dtype=np.float32)
        force = np.full(history.depth_m.shape, np.nan)
        for number in range(len(history)):
            ideal_v, force[number] = run.frame(history, number)
            voltage[number] = self.protocol.gapped(run.electronics.scan(ideal_v, history.time_s[number], exact=ideal))
            if progress:
                progress(number + 1, len(history))
        if not ideal:
            force += self.truth.rng(f"load cell {purpose}").normal(0.0, self.truth.noise.force_n, force.shape)
        return Frames(voltage, replace(history, force_n=force))

    def specimen(self, cycles: int = 5) -> Specimen:
        """The compressometer test: up to the law's closing stress and back, with the pair's own memory."""
        rng = self.truth.rng("specimen")
        up: Array = np.linspace(0.0, 6e4, 61)
        stress = np.tile(np.concatenate([up, up[-2::-1]]), cycles)
        time_s: Array = 0.5 * np.arange(len(stress), dtype=float)
        hysteresis, creep = self.truth.parameters("piezo_hysteresis"), self.truth.parameters("piezo_creep")
        wedge = WedgeMemory(**hysteresis) if hysteresis else None
        ladder = LogCreep(**creep) if creep else None
        law = ClosingLaw(**self.truth.law)
        lagging = wedge.start(()) if wedge else None
        crept = ladder.start(()) if ladder else None
        resistance = np.empty(len(stress))
        for number, value in enumerate(stress):
            felt = np.asarray(value)
            if wedge is not None and lagging is not None:
                lagging, felt = wedge.follow(lagging, felt)
            resistance[number] = law.resistance_ohm(felt)
            if ladder is not None and crept is not None:
                crept = ladder.dwell(crept, felt, 0.5)
                resistance[number] *= ladder.factor(crept)
        resistance *= 1.0 + rng.normal(0.0, self.truth.noise.specimen_share, len(stress))
        return Specimen(stress, resistance, time_s, np.repeat(np.arange(cycles), 2 * len(up) - 1))

    def rigid_block(self) -> RigidBlock:
        """Pseudo-indentation of a rigid block: the support alone."""
        depth = np.linspace(0.0, 1e-3, 21)
        error = self.truth.rng("rigid block").normal(0.0, self.truth.noise.force_n, len(depth))
        return RigidBlock(depth, self.truth.support_n_per_m * depth + error)


class _Run:
    """A plan being run: the skin, one indenter, the electronics and the clock."""

    def __init__(self, bench: Bench, purpose: str) -> None:
        self.bench, self.truth = bench, bench.truth
        self.skin = BenchSkin(bench.sensor, bench.truth, bench.resolution)
        self.scan_s = bench.protocol.scan_s or 0.0
        self.stage = Stage(bench.truth, self.skin.stiffness_n_per_m)
        self._skewed = bench.truth.parameters("scan_skew") is not None
        self._instants_s = np.linspace(0.0, self.scan_s, 9 if self._skewed else 3)
        self.electronics = Electronics(bench.protocol, bench.truth, 0.0, purpose)
        silent = np.zeros(self.skin.sheet.points_m.shape[:2])
        rest = self.electronics.potentials_read(self.skin.transfer_ohm(silent, 0.0))
        self.electronics.top_v = float(rest.max())
        self._repeatability = Repeatability(bench.truth, purpose)
        self._press: int | None = None
        self._held = silent
        self._silent = silent
        self._now_s = 0.0
        self._previous = -1

    def frame(self, history: History, number: int) -> tuple[Array, Array]:
        """((K,M) ideal readings, (P,) mean forces) of one frame; frames must be asked for in order."""
        if history.press[number] != self._press:
            self._press = int(history.press[number])
            self._repeatability.next_press()
        time_s = float(history.time_s[number])
        touched = history.touched[number]
        moving = self._previous >= 0 and not np.array_equal(
            history.contact_m[number], history.contact_m[self._previous], equal_nan=True
        )
        if moving:
            left = float(history.time_s[self._previous]) + self.scan_s
            self._rest_on(self._held, left)
            self._held = self._silent
            self.stage.move(left + MOVE_S, None, 0.0)
        self._rest_on(self._held, time_s - MOVE_S)
        self._previous = number
        forces = self._forces(history, number, touched, time_s)
        landing = self._landing(history, number)
        gain = np.where(touched, self._repeatability.gain, 0.0)
        mean = np.trapezoid(forces, axis=0) / (len(forces) - 1)
        reading = self._scan(landing, gain * mean, gain * forces, time_s)
        mean = np.where(touched, mean, np.nan)
        if not touched.any():
            mean[0] = 0.0
        return reading, mean

    def _scan(self, landing_m: Array, mean_n: Array, forces_n: Array, time_s: float) -> Array:
        """(K,M) readings; where the press moves during the scan, interpolated between three of its forces."""
        course = forces_n.sum(axis=1)
        if not self._skewed or abs(course[-1] - course[0]) < 1e-6:
            return self._read(landing_m, mean_n, time_s)
        nodes = np.linspace(course[0], course[-1], 3)
        share = mean_n / mean_n.sum()
        reading = np.stack([self._read(landing_m, node * share, time_s) for node in nodes])
        at = np.interp(self.electronics.offset_s, self._instants_s, course)
        return np.einsum("kn,nkm->km", interpolation(nodes, at), reading)

    def _read(self, landing_m: Array, force_n: Array, time_s: float) -> Array:
        pressure = self.skin.pressure_pa(landing_m, force_n, self.stage.stiffened)
        middle = time_s + self.scan_s / 2
        self._held = pressure
        self._rest_on(pressure, middle)
        transfer = self.skin.transfer_ohm(pressure, middle, self._repeatability.scanned_ohm())
        return self.electronics.potentials_read(transfer)

    def _rest_on(self, pressure_pa: Array, until_s: float) -> None:
        self.skin.dwell(pressure_pa, max(until_s - self._now_s, 0.0))
        self._now_s = max(until_s, self._now_s)

    def _forces(self, history: History, number: int, touched: NDArray[np.bool_], time_s: float) -> Array:
        """(S,P) forces at the indenter's instants within the scan."""
        forces = np.zeros((len(self._instants_s), len(touched)))
        for contact in np.flatnonzero(touched):
            depth = history.depth_m[number, contact]
            if np.isfinite(depth):
                place = history.contact_m[number, contact]
                self.stage.move(time_s - MOVE_S, place, self.stage.command_m)
                self.stage.move(time_s, place, depth)
                forces[:, contact] = self.stage.during_scan(time_s, self._instants_s)
            else:
                forces[:, contact] = history.force_n[number, contact]
        return forces

    def _landing(self, history: History, number: int) -> Array:
        landing = self.skin.landing_m(history.contact_m[number])
        by_hand = bool(np.isnan(history.depth_m[number]).all())
        return self._repeatability.placed_m(landing) if by_hand else self._repeatability.landed_m(landing)
