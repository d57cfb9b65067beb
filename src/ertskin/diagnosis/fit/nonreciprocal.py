"""The part of the readings no resistor network explains, as a signal of the instrument's own effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, reduce
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.linear.pressed_frames import motions
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.effect import AcquisitionEffect, Effect, shown_by
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.skin import Skin, moments_of

Array = NDArray[np.float64]

REMEMBERED = 100
"""How many effects' maps are kept: one for each channel of 32, in three forms."""
CHUNK = 32
"""Frames whose readings are computed at a time."""
NEAR = 1e-3
"""Part of a scan's largest number by which each is moved for the derivatives of an instrument that isn't linear."""


def instruments(effects: Sequence[Effect]) -> list[AcquisitionEffect]:
    """The effects on the readings, in the order in which they act on them."""
    acting = (e for e in effects if isinstance(e, AcquisitionEffect) and shown_by(e, Signal.NONRECIPROCAL))
    return sorted(acting, key=lambda e: e.order)


def acquires(effects: Sequence[Effect]) -> bool:
    """Whether the effects give readings no resistor network would give."""
    return bool(motions(effects) or instruments(effects))


def readings_met(change: Array) -> NDArray[np.intp] | slice:
    """Which readings a change (n,K*M) meets; all where most are, for taking them out costs more than it saves."""
    met = np.flatnonzero(change.any(axis=0))
    return met if 2 * len(met) < change.shape[1] else slice(None)


class AcquisitionSignal:
    """Readings with the instrument's effects, split as the evidence is."""

    def __init__(self, evidence: Evidence, linear: LinearSkin, rows: NDArray[np.intp]) -> None:
        self.evidence = evidence
        self.linear = linear
        self.rows = rows
        self.time_s = linear.history.time_s[linear.wanted]
        self._maps: dict[AcquisitionEffect, tuple[Array, Array]] = {}

    def scans(self, skin: Skin) -> Array:
        """(T,P) whitened scans as the instrument sees them."""
        return self.distorted(self.linear.scans(skin), instruments(skin.effects))

    def distorted(self, scans: Array, effects: Sequence[AcquisitionEffect]) -> Array:
        """(T,P) what the instrument makes of whitened scans (T,P), by ``effects`` in their order."""
        if all(effect.linear for effect in effects):
            for effect in effects:
                matrix, offset = self._map(effect)
                read, part = scans @ matrix.T + offset, effect.part_at(self.time_s)
                scans = read if part is None else scans + part[:, None] * (read - scans)
            return scans
        chunks = (slice(k, k + CHUNK) for k in range(0, len(scans), CHUNK))
        return np.concatenate([self._read(scans[chunk], effects, self.time_s[chunk]) for chunk in chunks])

    def _read(self, scans: Array, effects: Sequence[AcquisitionEffect], time_s: Array) -> Array:
        """The same by way of all readings, which is what an effect that isn't linear takes."""
        protocol = self.evidence.protocol
        readings = (scans @ protocol.orthonormal.T).reshape(-1, *protocol.shape)
        change = self._as_read(readings, effects, time_s) - readings
        return np.asarray(scans + change.reshape(len(scans), -1) @ protocol.orthonormal)

    def derivatives(self, skin: Skin, moved: Sequence[Skin]) -> tuple[Array, Array]:
        """What ``moved`` skins (c of them), whose networks are the skin's, change of its scans, (T,P,c) in volt, and of
        what no network explains, (c,n,K*M) in units of the noise."""
        protocol, basis = self.evidence.protocol, self.evidence.protocol.orthonormal
        scans = self.linear.scans(skin)
        found = np.zeros((*scans.shape, len(moved)))
        for first in range(0, len(scans), CHUNK):
            part = slice(first, first + CHUNK)
            readings = (scans[part] @ basis.T).reshape(-1, *protocol.shape)
            changes = self._changes(readings, skin, moved, self.time_s[part])
            # Chunk by chunk: numbers written far from one another take longer than the product.
            found[part] = np.stack([self._whitened(change) for change in changes], axis=-1)
        beyond = np.zeros((len(moved), len(self.rows), len(basis)))
        taken = self.evidence.leftover_v[self.rows].reshape(beyond.shape[1:]) != 0
        scale = np.where(taken, 1 / self.evidence.leftover_noise_v, 0.0)
        for one, change in zip(
            beyond, self._changes(self.readings(skin), skin, moved, self.time_s[self.rows]), strict=True
        ):
            np.multiply(self._unexplained(change), scale, out=one)
        return found, beyond

    def _changes(self, readings: Array, skin: Skin, moved: Sequence[Skin], time_s: Array) -> Iterator[Array]:
        """(n,K*M) what the instrument of each of the ``moved`` skins makes of a network's readings (n,K,M) at times
        (n,), less what the skin's own makes of them."""
        effects, protocol = instruments(skin.effects), self.evidence.protocol
        read = list(accumulate(effects, lambda done, one: one.read_v(done, protocol, time_s), initial=readings))
        for other in moved:
            done = readings
            for (before, after), own, effect in zip(pairwise(read), effects, instruments(other.effects), strict=True):
                done = self._read_anew(done, before, after, own, effect, time_s)
            yield (done - read[-1]).reshape(len(readings), -1)

    def _read_anew(
        self,
        moved: Array,
        before: Array,
        after: Array,
        own: AcquisitionEffect,
        effect: AcquisitionEffect,
        time_s: Array,
    ) -> Array:
        """(n,K,M) what an ``effect`` makes of ``moved`` readings, where its ``own`` form makes ``after`` of those
        ``before``: only what differs is read anew, if it can be."""
        if effect == own and moved is before:
            return after
        if effect != own or not effect.by_reading:
            return effect.read_v(moved, self.evidence.protocol, time_s)
        differs, found = moved != before, after.copy()
        found[differs] = effect.distorted_v(moved[differs], self.evidence.protocol)
        return found

    def on_columns(self, skin: Skin) -> Array | None:
        """(P,P) what the instrument makes of a change of whitened scans, None where it leaves them alone.

        That of the mean scan, where the instrument isn't linear, and at its mean where it changes with time.
        """
        maps = [self._mean_map(effect) for effect in instruments(skin.effects)]
        return reduce(lambda done, matrix: matrix @ done, maps) if maps else None

    def _mean_map(self, effect: AcquisitionEffect) -> Array:
        matrix, part = self._map(effect)[0], effect.part_at(self.time_s)
        if part is None:
            return matrix
        untouched = np.eye(len(matrix))
        return np.asarray(untouched + part.mean() * (matrix - untouched))

    def _map(self, effect: AcquisitionEffect) -> tuple[Array, Array]:
        """``on_scans``, remembered: most parameters that a fit moves leave the instrument alone."""
        if effect not in self._maps:
            self._maps = {**dict(list(self._maps.items())[-REMEMBERED:]), effect: self.on_scans(effect)}
        return self._maps[effect]

    def on_scans(self, effect: AcquisitionEffect) -> tuple[Array, Array]:
        """What an effect does to whitened scans near the mean one: matrix (P,P) and offset (P,)."""
        protocol = self.evidence.protocol
        basis = protocol.orthonormal
        about = self._mean_scan if not effect.linear else np.zeros(basis.shape[1])
        step = NEAR * float(np.abs(about).max()) if about.any() else 1.0
        mean = basis @ about

        def change(readings: Array) -> Array:
            read = effect.distorted_v(readings.reshape(-1, *protocol.shape), protocol)
            return self._whitened(read.reshape(readings.shape) - readings)

        own = change(mean[None])
        chunks = (basis[:, k : k + CHUNK] for k in range(0, len(about), CHUNK))
        moved = np.concatenate([change(mean + step * chunk.T) for chunk in chunks])
        matrix = np.eye(len(about)) + (moved - own).T / step
        return matrix, about + own[0] - matrix @ about

    def _whitened(self, readings: Array) -> Array:
        """(n,P) whitened scans of readings (n,K*M), most of which are nought where one channel's effect made them."""
        met = readings_met(readings)
        return np.asarray(readings[:, met] @ self.evidence.protocol.orthonormal[met])

    @cached_property
    def largest_v(self) -> float:
        """The largest reading, either sign, of what networks explain of the rows."""
        scans = self.evidence.scan_v[self.rows]
        return float(np.nanmax(np.abs(scans @ self.evidence.protocol.orthonormal.T)))

    @cached_property
    def _mean_scan(self) -> Array:
        """(P,) the mean of the scans recorded."""
        return np.asarray(np.nan_to_num(np.nanmean(self.evidence.scan_v, axis=0)))

    def leftover(self, skin: Skin) -> Array:
        """(n, K*M) what no network explains of the predicted readings, for the rows n."""
        return self._unexplained(self._as_read(self.readings(skin), instruments(skin.effects), self.time_s[self.rows]))

    def _as_read(self, readings: Array, effects: Sequence[AcquisitionEffect], time_s: Array) -> Array:
        """What the effects, in their order, make of a network's readings (n,K,M) at times (n,)."""
        return reduce(lambda done, effect: effect.read_v(done, self.evidence.protocol, time_s), effects, readings)

    def _unexplained(self, readings: Array) -> Array:
        """(n, K*M) the part of readings (n,K,M) that no network gives."""
        flat = readings.reshape(len(readings), -1)
        return np.asarray(flat - self._whitened(flat) @ self.evidence.protocol.orthonormal.T)

    def beyond_networks(self, effect: AcquisitionEffect, readings: Array) -> Array:
        """(n, K*M) what an effect adds to readings (n,K,M) that no network gives."""
        return self._unexplained(effect.distorted_v(readings, self.evidence.protocol) - readings)

    def readings(self, skin: Skin) -> Array:
        """(n,K,M) the network's readings in the rows n, before the instrument's effects."""
        protocol, linear = self.evidence.protocol, self.linear
        basis = protocol.orthonormal
        skew = motions(skin.effects)
        shape = (len(self.rows), *protocol.shape)
        if not skew or not protocol.timed:
            return (linear.still_scans(skin, linear.force_n)[self.rows] @ basis.T).reshape(shape)
        weights = moments_of(skew[0], protocol)[1]
        still = linear.skewed(skin, linear.force_n)
        parts = (
            part[:, None] * (one[self.rows] @ basis.T).reshape(shape)
            for part, one in zip(weights.T, still, strict=True)
        )
        return reduce(np.add, parts)

    def residual(self, skin: Skin) -> Array:
        """(n, K*M) leftover not explained, in units of the noise; nought for readings left out."""
        found = self.evidence.leftover_v[self.rows].reshape(len(self.rows), -1).astype(float)
        wrong = (found - self.leftover(skin)) / self.evidence.leftover_noise_v
        return np.where(found != 0, wrong, 0.0)
