"""Where a misfit sits: its size along every axis a person would ask about, tested against the noise."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from ertskin.diagnosis.criteria import Criteria
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AxisTest:
    """How unevenly the misfit spreads along an axis: rms over noise by group, and the chance of that under noise."""

    axis: str
    label: tuple[str, ...]
    ratio: tuple[float, ...]
    p_value: float


def axis_tests(residual: Array, history: History, protocol: Protocol) -> list[AxisTest]:
    """Tests of whitened residuals (T,P) in units of the noise along every axis, Bonferroni-corrected."""
    touched = np.asarray(history.touched.any(axis=1) & residual.any(axis=1))
    if not touched.any():
        return []
    energy = (residual**2).sum(axis=1)
    width = residual.shape[1]
    force = np.nan_to_num(history.force_n).sum(axis=1)
    edges = np.quantile(force[touched], [0, 0.25, 0.5, 0.75, 1.0])
    band = np.clip(np.searchsorted(edges, force, side="right") - 1, 0, 3)
    quarter = np.clip((4 * np.arange(len(history))) // max(len(history), 1), 0, 3)
    place_m, place = np.unique(
        np.round(np.nan_to_num(history.contact_m[:, 0], nan=-1.0), 4), axis=0, return_inverse=True
    )
    tests = [
        _groups(
            "force",
            energy,
            width,
            band,
            touched,
            [f"{a:.2g} to {b:.2g} N" for a, b in itertools.pairwise(edges)],
        ),
        _groups("history", energy, width, history.phase.astype(int), touched, ["rest", "loading", "hold", "unloading"]),
        _groups("time", energy, width, quarter, touched, ["first", "second", "third", "last quarter"]),
        _groups("place", energy, width, place.ravel(), touched, [_millimetres(at_m) for at_m in place_m]),
        _electrodes(residual[touched], protocol),
    ]
    return [AxisTest(t.axis, t.label, t.ratio, min(1.0, t.p_value * len(tests))) for t in tests]


def depends_on(tests: list[AxisTest], criteria: Criteria) -> list[str]:
    """Axes along which the misfit changes, most uneven first."""
    much = criteria.mismatch_ratio
    uneven = [t for t in tests if t.p_value < criteria.chance and max(t.ratio) > much * max(min(t.ratio), 1e-9)]
    return [t.axis for t in sorted(uneven, key=lambda t: -max(t.ratio) / max(min(t.ratio), 1e-9))]


def _millimetres(at_m: Array) -> str:
    return "({:.4g}, {:.4g}) mm".format(*(1e3 * at_m))


def _groups(
    axis: str, energy: Array, width: int, group: NDArray[np.integer], used: NDArray[np.bool_], labels: list[str]
) -> AxisTest:
    """Chi-square of the groups' mean energies about their common mean, its spread taken from the frames themselves."""
    ratio, label, mean, weight = [], [], [], []
    for number in np.unique(group[used]):
        mine = energy[used & (group == number)]
        if len(mine) < 2:
            continue
        ratio.append(float(np.sqrt(mine.mean() / width)))
        label.append(labels[number])
        mean.append(mine.mean())
        weight.append(len(mine) / max(mine.var(ddof=1), 2.0 * width))
    if len(mean) < 2:
        return AxisTest(axis, tuple(label), tuple(ratio), 1.0)
    center = np.average(mean, weights=weight)
    statistic = float((np.array(weight) * (np.array(mean) - center) ** 2).sum())
    return AxisTest(axis, tuple(label), tuple(ratio), float(chi2.sf(statistic, len(mean) - 1)))


def _electrodes(residual: Array, protocol: Protocol) -> AxisTest:
    """Misfit of the readings at each electrode (as reader), against the median electrode."""
    # A column of readings is an electrode only where each is taken at one, against the sink.
    if protocol.shape[1] != protocol.electrodes or not _reads_single_electrodes(protocol):
        return AxisTest("electrode", (), (), 1.0)
    basis = protocol.orthonormal.reshape(*protocol.shape, -1)
    ratio, freedom = [], np.inf
    for electrode in range(protocol.electrodes):
        part = basis[:, electrode]
        expected = float((part**2).sum())
        ratio.append(float(np.sqrt(((residual @ part.T) ** 2).sum() / (expected * len(residual)))))
        freedom = min(freedom, expected**2 / float(((part @ part.T) ** 2).sum()) * max(len(residual), 1))
    squares = np.array(ratio) ** 2
    score = (squares.max() - np.median(squares)) / (np.sqrt(2.0 / freedom) * max(np.median(squares), 1e-9))
    return AxisTest(
        "electrode",
        tuple(str(k) for k in range(protocol.electrodes)),
        tuple(ratio),
        float(protocol.electrodes * norm.sf(score)),
    )


def _reads_single_electrodes(protocol: Protocol) -> bool:
    """Whether every column of readings is one electrode's, in its turn, against electrodes that change."""
    usual = np.abs(protocol.measurement).mean(axis=0) > 0.5
    return bool(np.array_equal(usual, np.eye(protocol.electrodes, dtype=bool)))
