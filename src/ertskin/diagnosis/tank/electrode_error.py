"""Which electrode or channel reads wrong: what no resistor network explains of one scan, one by one.

A network's readings lie in a space of few dimensions (``Protocol.orthonormal``); the rest of a scan belongs to the
instrument. An electrode stands out where its share of that rest is larger than the others' shares would let one expect;
so does a channel, a column of readings, where these are differences of electrodes.

Where driven electrodes aren't read, a channel that reads the pair of an injection has the same error as that
injection's current: the two can't be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ertskin.diagnosis.judge.axis_tests import AxisTest
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LEVEL = 0.05
"""Chance that any electrode of a scan without a bad one is named."""
MOST = 3
"""Electrodes that may be named; with more, "the others" are no standard to go by."""
FOLDS = 4
PRIOR = 0.5
"""Odds that a scan has anything that reads wrong, before it is looked at."""


@dataclass(frozen=True, eq=False)
class ElectrodeErrors:
    """Rms error in volt of the potential of each electrode (L,), as far as no network explains it; NaN where unseen.

    ``named``: the electrodes that stand out, worst first, with the chance ``p_value`` of each, corrected for the number
    of electrodes, and how much the worst of what is left stands out: ``p_left``. ``left_v``: rms of what no network
    explains, per degree of freedom, with the readings of those named given up. Of ``channels`` the same.
    """

    rms_v: Array
    named: tuple[int, ...]
    p_value: tuple[float, ...]
    p_left: float
    left_v: float = np.nan
    channels: bool = False

    def weights(self, protocol: Protocol) -> list[Array]:
        """(K,M) for each that is named: what its error does to the readings."""
        pattern = channel_weights if self.channels else electrode_weights
        return [pattern(protocol, number) for number in self.named]

    def electrodes(self, protocol: Protocol) -> tuple[int, ...]:
        """The electrodes named, or those that the channels named read."""
        if not self.channels:
            return self.named
        read = [np.flatnonzero(protocol.measurement[:, channel].any(axis=0)) for channel in self.named]
        return tuple(dict.fromkeys(int(e) for several in read for e in several))

    def axis_test(self, noise_v: float) -> AxisTest:
        """The same as a test along the axis "electrode"."""
        seen = np.flatnonzero(np.isfinite(self.rms_v))
        ratio = tuple(float(v) for v in self.rms_v[seen] / noise_v)
        return AxisTest(
            "channel" if self.channels else "electrode",
            tuple(str(e) for e in seen),
            ratio,
            self.p_value[0] if self.named else self.p_left,
        )


@dataclass(frozen=True)
class ColumnError:
    """Gain and offset of one column of readings with standard errors; ``channel``: the column's number.

    A gain that a change of the network would hide is taken as none, with an infinite error.
    """

    channel: int
    gain: float
    gain_error: float
    offset_v: float
    offset_error_v: float


def electrode_errors(protocol: Protocol, voltage_v: Array, level: float = LEVEL) -> ElectrodeErrors:
    """Test of every electrode of a scan (K,M) in volt.

    One after the other the worst electrode is set aside: all its potentials, in every injection, are given up, so that
    its neighbours in difference readings aren't blamed. The logarithm of its error is held against the mean and
    spread of the others' (Student's t, corrected for their number): the generalised extreme studentised deviate of
    Rosner, Technometrics 25 (1983) 165. It supposes that errors of good electrodes are alike up to a log-normal factor.
    """
    weights = np.array([electrode_weights(protocol, k) for k in range(protocol.electrodes)])
    return _outlying(protocol, voltage_v, weights, level)


def channel_errors(protocol: Protocol, voltage_v: Array, level: float = LEVEL) -> ElectrodeErrors:
    """The same test of every channel: of the columns of a scan (K,M)."""
    weights = np.array([channel_weights(protocol, k) for k in range(protocol.shape[1])])
    return replace(_outlying(protocol, voltage_v, weights, level), channels=True)


def _outlying(protocol: Protocol, voltage_v: Array, weights: Array, level: float) -> ElectrodeErrors:
    """Which of the patterns of error ``weights`` (n,K,M) stand out."""
    network = protocol.orthonormal
    reading = voltage_v.ravel()
    every = _rms_v(protocol, network, reading, weights)
    rms, known = every, network
    named: list[int] = []
    chances: list[float] = []
    while True:
        worst = int(np.nanargmax(rms))
        known = _with(network, _patterns(weights[worst]))
        rest = _rms_v(protocol, known, reading, weights)
        rest[[*named, worst]] = np.nan
        chance = _chance(rms[worst], rest)
        if chance >= level or len(named) == MOST:
            freedom = max(protocol.count - network.shape[1], 1)
            left = float(np.linalg.norm(reading - network @ (network.T @ reading)) / np.sqrt(freedom))
            return ElectrodeErrors(every, tuple(named), tuple(chances), chance, left)
        named.append(worst)
        chances.append(chance)
        rms, network = rest, known


def surely(p_value: float) -> float:
    """Chance that what stands out with this p-value is wrong, at the best odds a p-value can stand for.

    Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62: the Bayes factor is at most 1 / (-e p ln p).
    """
    p = float(np.clip(p_value, 1e-300, np.exp(-1)))
    odds = PRIOR / float(-np.e * p * np.log(p))
    return odds / (1 + odds)


def column_errors(
    protocol: Protocol, voltage_v: Array, weight: Array, rows: Indices | None = None
) -> list[ColumnError]:
    """Gain and offset of the columns that a pattern of error (K,M) touches, from all injections of a scan or ``rows``.

    Least squares together with the network; standard errors from how the residuals of whole injections scatter.
    """
    rows = np.arange(protocol.shape[0]) if rows is None else rows
    columns = touched_by(protocol, weight)
    predicted = without(protocol, voltage_v, weight)
    shape = (*protocol.shape, 2 * len(columns))
    errors = np.zeros(shape)
    for k, column in enumerate(columns):
        errors[:, column, 2 * k] = predicted[:, column]
        errors[:, column, 2 * k + 1] = protocol.taken[:, column]
    network = protocol.orthonormal.reshape(*protocol.shape, -1)[rows].reshape(len(rows) * shape[1], -1)
    basis = np.linalg.qr(network)[0]
    design = errors[rows].reshape(-1, shape[2])
    size = np.linalg.norm(design, axis=0)
    design = design - basis @ (basis.T @ design)
    hidden = np.linalg.norm(design, axis=0) < 1e-6 * size
    design[:, hidden] = 0.0
    reading = voltage_v[rows].ravel()
    bread = np.linalg.pinv(design.T @ design, rcond=1e-12, hermitian=True)
    value = bread @ (design.T @ reading)
    left = reading - basis @ (basis.T @ reading) - design @ value
    scores = (design * left[:, None]).reshape(len(rows), shape[1], -1).sum(axis=1)
    error = np.where(hidden, np.inf, np.sqrt(np.diag(bread @ (scores.T @ scores) @ bread)))
    return [
        ColumnError(int(c), *(float(v) for v in (value[2 * k], error[2 * k], value[2 * k + 1], error[2 * k + 1])))
        for k, c in enumerate(columns)
    ]


def corrected(protocol: Protocol, voltage_v: Array, weight: Array) -> Array:
    """The scan (K,M) in volt with the columns touched mended, each quarter of the injections by the other ones."""
    mended = voltage_v.copy()
    predicted = without(protocol, voltage_v, weight)
    injection = np.arange(protocol.shape[0])
    for fold in range(FOLDS):
        out = injection % FOLDS == fold
        for c in column_errors(protocol, voltage_v, weight, injection[~out]):
            wrong = c.gain * predicted[out, c.channel] + c.offset_v
            mended[out, c.channel] -= wrong * protocol.taken[out, c.channel]
    return mended


def touched_by(protocol: Protocol, weight: Array) -> Indices:
    """Columns that a pattern of error (K,M) touches in more than half of the injections they are taken in."""
    touched = (weight != 0).sum(axis=0)
    return np.flatnonzero(touched > 0.5 * np.maximum(protocol.taken.sum(axis=0), 1))


def without(protocol: Protocol, voltage_v: Array, weight: Array) -> Array:
    """(K,M) readings in volt of the network that fits the scan with what lies along the pattern (K,M) given up."""
    network = protocol.orthonormal
    pattern = np.linalg.qr(_patterns(weight))[0]

    def kept(value: Array) -> Array:
        return np.asarray(value - pattern @ (pattern.T @ value))

    return np.asarray(network @ np.linalg.lstsq(kept(network), kept(voltage_v.ravel()), rcond=1e-9)[0]).reshape(
        protocol.shape
    )


def unexplained_v(protocol: Protocol, voltage_v: Array) -> Array:
    """(K,M) what no network explains of a scan, in volt."""
    network = protocol.orthonormal
    reading = voltage_v.ravel()
    return np.asarray(reading - network @ (network.T @ reading)).reshape(protocol.shape)


def rms_v(protocol: Protocol, voltage_v: Array) -> float:
    """Rms in volt of what no network explains, per degree of freedom."""
    freedom = protocol.count - protocol.orthonormal.shape[1]
    return float(np.sqrt((unexplained_v(protocol, voltage_v) ** 2).sum() / max(1, freedom)))


def electrode_weights(protocol: Protocol, electrode: int) -> Array:
    """(K,M) what an error of an electrode's potential does to the readings of each injection, of length one or none."""
    weight = protocol.measurement[:, :, electrode]
    return np.asarray(weight / np.maximum(np.linalg.norm(weight, axis=1), 1e-300)[:, None])


def channel_weights(protocol: Protocol, channel: int) -> Array:
    """(K,M) the readings of one column, one where they are taken."""
    weight = np.zeros(protocol.shape)
    weight[:, channel] = protocol.taken[:, channel]
    return weight


def _patterns(weight: Array) -> Array:
    """(K*M, n) a pattern of error (K,M), a column per injection."""
    rows = np.flatnonzero(weight.any(axis=1))
    pattern = np.zeros((*weight.shape, len(rows)))
    pattern[rows, :, np.arange(len(rows))] = weight[rows]
    return pattern.reshape(-1, len(rows))


def _rms_v(protocol: Protocol, known: Array, reading: Array, weights: Array) -> Array:
    """(n,) rms of the readings along each of the patterns (n,K,M) that the orthonormal columns ``known`` leave."""
    left = (reading - known @ (known.T @ reading)).reshape(protocol.shape)
    taken = known.reshape(*protocol.shape, -1)
    rms = np.full(len(weights), np.nan)
    for number, weight in enumerate(weights):
        along = np.matmul(weight[:, None, :], taken)
        freedom = weight.any(axis=1).sum() - float((along**2).sum())
        if freedom > 1:
            rms[number] = np.sqrt(((weight * left).sum(axis=1) ** 2).sum() / freedom)
    return rms


def _with(known: Array, pattern: Array) -> Array:
    """Orthonormal columns that span ``known`` and ``pattern``."""
    new = pattern - known @ (known.T @ pattern)
    vector, size, _ = np.linalg.svd(new, full_matrices=False)
    return np.column_stack([known, vector[:, size > 1e-6]])


def _chance(value: float, others: Array) -> float:
    """Probability that any of n electrodes stands out from the others as ``value`` does from ``others``."""
    log = np.log(np.maximum(others[np.isfinite(others)], 1e-300))
    if len(log) < 4 or not value > 0:
        return 1.0
    spread = max(float(log.std(ddof=1)), 1e-12) * np.sqrt(1 + 1 / len(log))
    return float(min(1.0, (len(log) + 1) * student.sf((np.log(value) - log.mean()) / spread, len(log) - 1)))
