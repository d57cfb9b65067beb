"""A foam coupon's model: an elastic curve of the strain, foam effects with memory, and the instrument's own errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import least_squares, nnls

from ertskin.diagnosis.coupon.compression import Compression
from ertskin.physics.effects.effect import FoamEffect, Strokes

Array = NDArray[np.float64]

PLATEAU = 0.3
"""Strain up to which the elastic curve's shape is free."""
DENSE = (1.0, 2.0, 4.0)
"""Powers of the stretch that carry densification (Ogden-Hill hyperfoam without lateral strain)."""
LATENCY_S = 0.06
ZERO_N = 1.0
STEPS = 100


def elastic_shapes(strain: Array) -> Array:
    """(N,P) curves of the strain (N,) that add up, with weights not negative, to any rising curve of a foam.

    Faces settling and cell walls buckling: monotone splines up to ``PLATEAU``. Beyond: the strain itself and terms of
    the hyperfoam in the stretch, which also say how it goes on past the strains fitted.
    """
    strain = np.clip(strain, 0.0, 0.95)
    knots = PLATEAU * np.linspace(0.0, 1.0, 9) ** 1.5
    padded = np.concatenate([[0.0] * 3, knots, [PLATEAU] * 3])
    humps = BSpline.design_matrix(np.minimum(strain, PLATEAU), padded, 3).toarray()
    rising = np.cumsum(humps[:, ::-1], axis=1)[:, -2::-1]
    dense = [0.4**power * ((1 - strain) ** -power - 1) / power for power in DENSE]
    return np.column_stack([rising, strain, *dense])


@dataclass(frozen=True, eq=False)
class CouponModel:
    """A coupon's fitted model. ``elastic_pa`` (P,) weighs ``elastic_shapes``; the load cell reads ``-zero_n`` in air.

    ``covariance`` of ``names``, widened by how long the residuals stay alike.
    """

    elastic_pa: Array
    effects: tuple[FoamEffect, ...]
    zero_n: float = 0.0
    latency_s: float = 0.0
    names: tuple[str, ...] = ()
    covariance: Array | None = None

    def force_n(self, test: Compression) -> Array:
        """(N,) predicted readings of the load cell."""
        strokes, shapes = _undergone(test, self.latency_s)
        force = test.area_m2 * (shapes @ self.elastic_pa)
        for effect in sorted(self.effects, key=lambda e: e.order):
            force = effect.reaction_n(force, strokes)
        return np.asarray(force - self.zero_n)

    def error(self, effect: FoamEffect, key: str) -> float:
        """Standard error of an effect's parameter; NaN where it wasn't fitted."""
        name = f"{effect.name}.{key}"
        if self.covariance is None or name not in self.names:
            return float("nan")
        k = self.names.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))


@lru_cache(maxsize=16)
def _undergone(test: Compression, latency_s: float) -> tuple[Strokes, Array]:
    """What the foam went through and ``elastic_shapes`` there: a fit asks for few latencies, many times each."""
    strokes = test.strokes(latency_s)
    return strokes, elastic_shapes(strokes.sink_m / test.height_m)


def elastic_model(tests: Sequence[Compression], rows: Sequence[NDArray[np.bool_]]) -> CouponModel:
    """The elastic curve alone, fitted to the samples ``rows`` (N,) of each test."""
    shapes = [t.area_m2 * elastic_shapes(t.sink_m()[r] / t.height_m) for t, r in zip(tests, rows, strict=True)]
    force = [t.force_n[r] for t, r in zip(tests, rows, strict=True)]
    return CouponModel(nnls(np.concatenate(shapes), np.concatenate(force))[0], ())


def fit_coupon(
    tests: Sequence[Compression],
    rows: Sequence[NDArray[np.bool_]],
    effects: tuple[FoamEffect, ...],
    held: frozenset[str] = frozenset(),
) -> CouponModel:
    """Least squares over the samples ``rows`` of one test, or of several that are taken to share their parameters.

    ``held`` names parameters ("effect.key") that keep the values they come with.
    """
    keys = [
        (k, key)
        for k, effect in enumerate(effects)
        for key in effect.parameters()
        if f"{effect.name}.{key}" not in held
    ]
    known = [effects[k].parameters()[key] for k, key in keys]
    elastic = elastic_model(tests, rows).elastic_pa
    unit = float(elastic.sum()) / len(elastic)

    def model(x: Array) -> CouponModel:
        changed = list(effects)
        for (k, key), value in zip(keys, x[2:], strict=False):
            changed[k] = replace(changed[k], **{key: float(value)})
        return CouponModel(unit * x[2 + len(keys) :], tuple(changed), float(x[0]), float(x[1]))

    def wrong(x: Array) -> Array:
        now = model(x)
        return np.concatenate([(now.force_n(t) - t.force_n)[r] for t, r in zip(tests, rows, strict=True)])

    low = np.array([-ZERO_N, -LATENCY_S, *(p.low for p in known), *np.zeros(len(elastic))])
    high = np.array([ZERO_N, LATENCY_S, *(p.high for p in known), *np.full(len(elastic), np.inf)])
    start = np.array([0.1, 0.0, *(getattr(effects[k], key) for k, key in keys), *(elastic / unit)])
    start = np.clip(start, low + 1e-6, high - 1e-6)
    scale = np.array([0.1, 0.01, *(p.typical for p in known), *np.ones(len(elastic))])
    found = least_squares(wrong, start, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=STEPS)
    names = ("zero", "latency", *(f"{effects[k].name}.{key}" for k, key in keys))
    return replace(
        model(found.x), names=names, covariance=_covariance(found.jac, found.fun)[: len(names), : len(names)]
    )


def _covariance(jacobian: Array, residual: Array) -> Array:
    """Of the parameters, from the residuals' size and from how long they stay alike."""
    variance = float((residual**2).sum()) / max(1, len(residual) - jacobian.shape[1])
    return np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12) * variance * memory(residual))


def memory(residual: Array) -> float:
    """Samples that share one independent residual: 1 + 2 sum of the autocorrelation up to its first zero."""
    centered = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(centered, 2 * len(centered))) ** 2
    alike = np.fft.irfft(spectrum)[: len(centered)]
    if alike[0] <= 0:
        return 1.0
    alike = alike / alike[0]
    end = int(np.argmax(alike <= 0)) or len(alike)
    return float(1 + 2 * alike[1:end].sum())


def rmse_n(model: CouponModel, test: Compression, rows: NDArray[np.bool_]) -> float:
    """Root mean square error in newton over the samples ``rows``."""
    return float(np.sqrt(((model.force_n(test) - test.force_n)[rows] ** 2).mean()))
