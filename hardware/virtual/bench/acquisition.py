"""The bench's electronics: what stands between the electrodes' potentials and the numbers in the file."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.bench.truth import Noise, Truth
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


class Electronics:
    """Reads scans (K,M) volt off transfer matrices (L,L) ohm; remembers the last scan for a channel that freezes."""

    def __init__(self, protocol: Protocol, truth: Truth, top_v: float, purpose: str) -> None:
        """``top_v``: the largest reading at rest, against which a saturation is set."""
        self.protocol, self.truth, self.top_v = protocol, truth, top_v
        self._rng = truth.rng(f"noise {purpose}")
        self._hum_phase = self._rng.uniform(0, 2 * np.pi)
        self._frozen_for = 0
        self._last: Array | None = None

    @property
    def offset_s(self) -> Array:
        """(K,) when each injection is read after the start of the scan."""
        offset = self.protocol.injection_offset_s
        return np.zeros(self.protocol.shape[0]) if offset is None else offset

    def potentials_read(self, transfer_ohm: Array) -> Array:
        """(K,M) ideal readings of a transfer matrix, plus the drop of an electrode that is no resistor."""
        potential = self.protocol.injection_current_a @ transfer_ohm
        diode = self.truth.parameters("schottky_electrode")
        if diode:
            current = self.protocol.injection_current_a[:, diode["electrode"]]
            drop = diode["drop_v"] * np.arcsinh(current / diode["knee_a"])
            potential[:, diode["electrode"]] += np.where(current > 0, drop, 0.55 * drop)
        return np.einsum("kml,kl->km", self.protocol.measurement, potential)

    def scan(self, ideal_v: Array, time_s: float, exact: bool = False) -> Array:
        """(K,M) what the file gets for ideal readings (K,M); ``exact``: without noise and rounding."""
        reading = self._amplified(self._heated(ideal_v))
        reading = self._carried_over(reading) + self._hum(time_s)
        reading = self._saturated(reading)
        if not exact:
            reading = self._converted(reading + self._noise(reading.shape))
        return self._frozen(reading)

    def _heated(self, reading: Array) -> Array:
        heat = self.truth.parameters("self_heating")
        if not heat:
            return reading
        progress = np.arange(len(reading)) / len(reading)
        warm = 1.0 + heat["share"] * (1.0 - np.exp(-progress / heat["settle_scans"]))
        return reading * warm[:, None]

    def _amplified(self, reading: Array) -> Array:
        reading = reading.copy()
        channel = self.truth.parameters("channel_gain")
        if channel:
            reading[:, channel["channel"]] *= 1.0 + channel["gain"]
            reading[:, channel["channel"]] += channel["offset_v"]
        curved = self.truth.parameters("curved_amplifier")
        if curved:
            reading += curved["per_volt"] * reading**2
        return reading

    def _carried_over(self, reading: Array) -> Array:
        """A slow multiplexer: each reading keeps a share of what the converter held before."""
        slow = self.truth.parameters("crosstalk")
        if not slow:
            return reading
        flat, taken = reading.ravel().copy(), np.flatnonzero(self.protocol.taken)
        held = flat[taken[0]]
        for number in taken:
            held = flat[number] = (1.0 - slow["share"]) * flat[number] + slow["share"] * held
        return flat.reshape(reading.shape)

    def _hum(self, time_s: float) -> Array | float:
        hum = self.truth.parameters("mains_hum")
        if not hum:
            return 0.0
        phase = 2 * np.pi * hum["frequency_hz"] * (time_s + self.offset_s) + self._hum_phase
        return hum["amplitude_v"] * np.sin(phase)[:, None] * np.array(hum["coupling"])

    def _saturated(self, reading: Array) -> Array:
        """A soft knee below the converter's own limit."""
        early = self.truth.parameters("adc_saturation")
        if not early:
            return reading
        limit, knee = self.top_v * (1.0 - early["below_top_share"]), early["knee_v"]
        return reading - knee * np.logaddexp(0.0, (reading - limit) / knee)

    def _noise(self, shape: tuple[int, ...]) -> Array:
        noise: Noise = self.truth.noise
        white = self._rng.normal(0.0, 1.0, shape)
        if noise.coloured_share > 0.0:
            memory = 0.97
            slow = self._rng.normal(0.0, 1.0, shape)
            for injection in range(1, shape[0]):
                slow[injection] = memory * slow[injection - 1] + np.sqrt(1 - memory**2) * slow[injection]
            white = np.sqrt(1 - noise.coloured_share) * white + np.sqrt(noise.coloured_share) * slow
        error = noise.white_v * white
        if noise.spike_share > 0.0:
            hit = self._rng.random(shape) < noise.spike_share
            error = error + hit * self._rng.laplace(0.0, noise.spike_v, shape)
        return error

    def _converted(self, reading: Array) -> Array:
        protocol = self.protocol
        if protocol.adc_volts_per_count is not None:
            reading = np.round(reading / protocol.adc_volts_per_count) * protocol.adc_volts_per_count
        if protocol.adc_limit_v is not None:
            reading = np.clip(reading, -protocol.adc_limit_v, protocol.adc_limit_v)
        return reading

    def _frozen(self, reading: Array) -> Array:
        stuck = self.truth.parameters("frozen_channel")
        if stuck:
            begin = stuck["share"] / (1.0 - stuck["share"]) / stuck["spell_frames"]
            if self._frozen_for == 0 and self._rng.random() < begin:
                self._frozen_for = stuck["spell_frames"]
            if self._frozen_for > 0 and self._last is not None:
                reading[:, stuck["channel"]] = self._last[:, stuck["channel"]]
                self._frozen_for -= 1
            self._last = reading.copy()
        return reading
