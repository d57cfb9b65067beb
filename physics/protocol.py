"""Which currents go in and which potentials are read, and the 276 numbers behind the 6624 readings.

A passive reciprocal network with L electrodes is described by a symmetric (L,L) *transfer matrix* T: potentials of the
electrodes (mean-free) for one ampere into each, T = T', T 1 = 0. Its L(L-1)/2 free numbers are the *pair
resistances* r_ij = T_ii + T_jj - 2 T_ij: the voltage across i and j for one ampere through them. Every reading of
every protocol is a fixed linear combination of them: with current c into the electrodes and the difference w'U
measured, reading = w'T c = -1/2 sum_ij w_i c_j r_ij (both c and w sum to zero).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEEN = 1e-10
"""Share of the largest eigenvalue of design'design from which on a scan tells a combination of pair resistances."""


def electrode_pairs(electrodes: int) -> NDArray[np.intp]:
    """(L(L-1)/2, 2) all pairs i < j in lexicographic order: the full injection pattern of the paper (II-D)."""
    i, j = np.triu_indices(electrodes, 1)
    return np.stack([i, j], axis=1)


def pair_resistances(transfer: Array) -> Array:
    """(..., L(L-1)/2) pair resistances in ohm of transfer matrices (..., L, L) in ohm."""
    i, j = np.triu_indices(transfer.shape[-1], 1)
    diagonal = np.diagonal(transfer, axis1=-2, axis2=-1)
    return diagonal[..., i] + diagonal[..., j] - transfer[..., i, j] - transfer[..., j, i]


def transfer_matrix(pair_resistance: Array) -> Array:
    """(..., L, L) mean-free transfer matrix of pair resistances (..., L(L-1)/2): T = -1/2 J r J, J the centring."""
    pairs = pair_resistance.shape[-1]
    electrodes = round((1 + np.sqrt(1 + 8 * pairs)) / 2)
    i, j = np.triu_indices(electrodes, 1)
    squared = np.zeros((*pair_resistance.shape[:-1], electrodes, electrodes))
    squared[..., i, j] = pair_resistance
    squared[..., j, i] = pair_resistance
    centred = squared - squared.mean(axis=-1, keepdims=True)
    return -0.5 * (centred - centred.mean(axis=-2, keepdims=True))


def gram_factor(rows: Array) -> Array:
    """(n,P) C with C'C = rows'rows for rows (R,P) of rank n: upper triangular if n = P, else of orthogonal rows."""
    gram = rows.T @ rows
    value, vector = np.linalg.eigh(gram)
    seen = value > SEEN * value[-1]
    if seen.all():
        return np.asarray(np.linalg.cholesky(gram).T)
    return np.asarray(np.sqrt(value[seen])[:, None] * vector[:, seen].T)


def inverse_factor(factor: Array) -> Array:
    """(P,n) pseudo-inverse of what ``gram_factor`` gives."""
    if factor.shape[0] == factor.shape[1]:
        # Triangular, so that no pivot moves; scipy.linalg takes longer to import than many a command to run.
        return np.asarray(np.linalg.inv(factor))
    return np.asarray(factor.T / (factor**2).sum(axis=1))


@dataclass(frozen=True, eq=False)
class Protocol:
    """Injections and measurements of one scan.

    ``injection_current_a`` (K,L): ampere into each electrode, rows sum to zero. ``measurement`` (K,M,L): weights of the
    electrode potentials in each reading, summing to zero over L. ``pairs`` (K,2) names source and sink where every
    injection is a pair. ``injection_offset_s`` (K,): when each injection is read after the frame's time. ``measured``
    (K,M): the readings that the instrument takes, all without it; the others have no weights, and are nought wherever
    readings are computed with. ``passed`` (K,M,L): the weights of all readings, for a multiplexer may pass those too.
    """

    injection_current_a: Array
    measurement: Array
    pairs: NDArray[np.intp] | None = None
    injection_offset_s: Array | None = None
    scan_s: float | None = None
    adc_volts_per_count: float | None = None
    adc_limit_v: float | None = None
    measured: NDArray[np.bool_] | None = None
    passed: Array | None = None

    def __post_init__(self) -> None:
        if self.passed is None:
            object.__setattr__(self, "passed", self.measurement)
        if self.measured is not None:
            object.__setattr__(self, "measurement", np.where(self.measured[:, :, None], self.measurement, 0.0))

    @classmethod
    def against_sink(cls, pairs: NDArray[np.intp], electrodes: int, current_a: float, **extra: object) -> Protocol:
        """The paper's pattern: every electrode read against the sink of each injection; K x L readings."""
        rows = np.arange(len(pairs))
        current = np.zeros((len(pairs), electrodes))
        current[rows, pairs[:, 0]] = current_a
        current[rows, pairs[:, 1]] = -current_a
        weights = np.broadcast_to(np.eye(electrodes), (len(pairs), electrodes, electrodes)).copy()
        weights[rows, :, pairs[:, 1]] -= 1.0
        return cls(current, weights, np.asarray(pairs, dtype=np.intp), **extra)  # type: ignore[arg-type]

    @classmethod
    def differences(cls, injection_current_a: Array, measurement: NDArray[np.intp], **extra: object) -> Protocol:
        """Currents (K,L) and readings of electrode ``[m,0]`` minus electrode ``[m,1]``, for every injection."""
        injections, electrodes = injection_current_a.shape
        rows = np.arange(len(measurement))
        weights = np.zeros((len(measurement), electrodes))
        weights[rows, measurement[:, 0]] += 1.0
        weights[rows, measurement[:, 1]] -= 1.0
        every = np.broadcast_to(weights, (injections, *weights.shape)).copy()
        return cls(np.asarray(injection_current_a, dtype=float), every, None, **extra)  # type: ignore[arg-type]

    @property
    def electrodes(self) -> int:
        """Number of electrodes L."""
        return self.injection_current_a.shape[1]

    @property
    def shape(self) -> tuple[int, int]:
        """(K, M): injections, readings per injection."""
        return self.measurement.shape[0], self.measurement.shape[1]

    @cached_property
    def taken(self) -> NDArray[np.bool_]:
        """(K,M) the readings that the instrument takes."""
        return np.ones(self.shape, dtype=bool) if self.measured is None else self.measured

    @property
    def count(self) -> int:
        """Number of readings taken in a scan."""
        return int(self.taken.sum())

    @property
    def duration_s(self) -> float:
        """How long a scan takes, at least from its first injection to its last; nought where that isn't known."""
        if self.scan_s:
            return self.scan_s
        return 0.0 if self.injection_offset_s is None else float(np.ptp(self.injection_offset_s))

    @property
    def timed(self) -> bool:
        """Whether it is known that the injections are read one after another."""
        return self.injection_offset_s is not None and bool(np.ptp(self.injection_offset_s) > 0)

    def filled(self, voltage_v: Array) -> Array:
        """Readings (..., K, M) with nought where none is taken, as they are computed with."""
        return np.where(self.taken, voltage_v, 0.0)

    def gapped(self, voltage_v: Array) -> Array:
        """Readings (..., K, M) with NaN where none is taken, as they are recorded."""
        return np.where(self.taken, voltage_v, np.nan)

    @cached_property
    def design(self) -> Array:
        """(K*M, P) readings in volt per ohm of pair resistance, P = L(L-1)/2."""
        return self._design(self.measurement)

    def _design(self, weight: Array) -> Array:
        i, j = np.triu_indices(self.electrodes, 1)
        current = self.injection_current_a
        both = weight[:, :, i] * current[:, None, j] + weight[:, :, j] * current[:, None, i]
        return -0.5 * both.reshape(-1, len(i))

    def with_passed(self, voltage_v: Array, contact_ohm: Array | float) -> Array:
        """Readings (..., K, M) with those that aren't taken as a multiplexer passes them.

        They are those of the smallest pair resistances that explain the readings taken, with a contact of so many ohm
        more at every electrode, or at each (L,): where no electrode that carries current is read nothing else tells of
        contacts.
        """
        from_taken, per_ohm = self._passed
        flat = self.filled(voltage_v).reshape(*voltage_v.shape[:-2], -1)
        found, contacts = np.array(flat), np.broadcast_to(contact_ohm, self.electrodes)
        found[..., ~self.taken.ravel()] = flat @ from_taken + per_ohm @ contacts
        return found.reshape(voltage_v.shape)

    @cached_property
    def _passed(self) -> tuple[Array, Array]:
        """Readings that aren't taken by those that are, (K*M,U), and by ohm of each contact, (U,L)."""
        assert self.passed is not None
        design = self._design(self.passed)[~self.taken.ravel()]
        first, second = np.triu_indices(self.electrodes, 1)
        of_pair = np.eye(self.electrodes)[first] + np.eye(self.electrodes)[second]
        return self.orthonormal @ (design @ self.inverse_factor).T, design @ of_pair

    @cached_property
    def factor(self) -> Array:
        """(n,P) C with C'C = design'design in volt per ohm: the n combinations of pair resistances the scan tells.

        Upper triangular where it tells all P of them, else of orthogonal rows.
        """
        return gram_factor(self.design)

    @cached_property
    def inverse_factor(self) -> Array:
        """(P,n) in ohm per volt: the pseudo-inverse of ``factor``."""
        return inverse_factor(self.factor)

    def readings(self, pair_resistance: Array) -> Array:
        """(..., K, M) volt of pair resistances (..., P) in ohm; by the transfer matrix, a sixth of the work."""
        flat = np.asarray(pair_resistance).reshape(-1, pair_resistance.shape[-1])
        potential = self.injection_current_a @ transfer_matrix(flat)
        voltage = np.matmul(self.measurement, potential.transpose(1, 2, 0))
        return np.moveaxis(voltage, -1, 0).reshape(*pair_resistance.shape[:-1], *self.shape)

    def reciprocal(self, voltage_v: Array) -> Array:
        """(..., P) least-squares pair resistances in ohm of readings (..., K, M) in volt.

        The smallest ones, where the scan doesn't tell them all.
        """
        flat = self.filled(voltage_v).reshape(*voltage_v.shape[:-2], -1)
        return self.unwhitened(flat @ self.orthonormal)

    @cached_property
    def orthonormal(self) -> Array:
        """(K*M, n) orthonormal basis of the readings that some resistor network could give."""
        return self.design @ self.inverse_factor

    def whitened(self, pair_resistance: Array) -> Array:
        """(..., n) volt: coordinates in ``orthonormal``; white reading noise of s volt stays white, s volt each."""
        return pair_resistance @ self.factor.T

    def unwhitened(self, coordinates_v: Array) -> Array:
        """(..., P) ohm: the inverse of ``whitened``; the smallest pair resistances, where the scan doesn't tell all."""
        return coordinates_v @ self.inverse_factor.T

    def split(self, voltage_v: Array) -> tuple[Array, Array]:
        """Readings (..., K, M) as (reciprocal part, the rest no resistor network could give), both in volt."""
        voltage = self.filled(voltage_v)
        flat = voltage.reshape(*voltage.shape[:-2], -1)
        part = ((flat @ self.orthonormal) @ self.orthonormal.T).reshape(voltage.shape)
        return part, voltage - part
