"""Elastic moduli of the pad from force and depth (paper III-B, Fig. 6).

A linear pad answers force and depth with one number, its compliance c = 1/k_sen: the error surface over (E_neo, E_lyc)
is a valley of pairs that share a compliance, and force-depth alone can't place a point along it. The fit therefore
takes the valley's point nearest to the nominal moduli (in their logarithms), and reports the surface's Hessian with the
combination that is fixed and the one that is not. The voltages give what is missing, the ratio of the moduli.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.mechanics.stiffness import sensor_depth_m, sensor_stiffness_n_per_m
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

Groups = Mapping[str, tuple[str, ...]]
"""Names of the unknown moduli, each with the layers that share it."""

_STEP = 1e-3
_STEPS = 40
_INSENSITIVE = 1e-10


def moduli_groups(sensor: Sensor, fixed: tuple[str, ...] = ("glue",)) -> dict[str, tuple[str, ...]]:
    """The paper's unknowns: one modulus for all layers of equal nominal modulus, but none for the ``fixed`` layers."""
    groups: dict[float, list[str]] = {}
    for layer in sensor.layers:
        if layer.name not in fixed:
            groups.setdefault(layer.youngs_modulus_pa, []).append(layer.name)
    return {names[0]: tuple(names) for names in groups.values()}


def with_moduli(sensor: Sensor, groups: Groups, moduli_pa: Array) -> Sensor:
    """The sensor with the groups' moduli (n,) in pascal, in the groups' order."""
    named = {name: float(e) for names, e in zip(groups.values(), moduli_pa, strict=True) for name in names}
    return sensor.with_layers(**named)


@dataclass(frozen=True, eq=False)
class ErrorSurface:
    """Rms difference between measured and simulated sensor depth in metre, ``rms_m`` (a,b), over a grid of two moduli.

    ``moduli_pa`` holds the two axes (a,) and (b,) in pascal, ``names`` their groups.
    """

    names: tuple[str, str]
    moduli_pa: tuple[Array, Array]
    rms_m: Array


@dataclass(frozen=True, eq=False)
class ModuliFit:
    """Moduli (n,) in pascal in the order of ``names``, and how well the data hold them.

    ``stiffness_n_per_m`` is k_sen with its standard error (scatter between presses where there are several).
    ``hessian`` (n,n) of half the chi-square in the moduli's logarithms; ``eigenvalues`` (n,) falling and
    ``eigenvectors`` (n,n) as columns: exp(fixed combination) is known to 1/sqrt(eigenvalue), the rest not at all.
    ``modulus_relative_error`` is that of the fixed combination. ``depth_rms_m`` is the misfit of the straight line.
    """

    names: tuple[str, ...]
    moduli_pa: Array
    stiffness_n_per_m: float
    stiffness_standard_error_n_per_m: float
    hessian: Array
    eigenvalues: Array
    eigenvectors: Array
    modulus_relative_error: float
    depth_rms_m: float


def measured_stiffness(
    depth_m: Array, force_n: Array, indenter_n_per_m: float, press: NDArray[np.integer] | None = None
) -> tuple[float, float]:
    """k_sen and its standard error from stage depths and forces (N,), the support's yielding taken off (eq. 4).

    The slope of the force against the sensor's depth through the origin, weighted by depth; a press's frames share its
    errors, so with ``press`` (N,) the error comes from the scatter between presses.
    """
    sinking = sensor_depth_m(depth_m, force_n, indenter_n_per_m)
    force = np.asarray(force_n, dtype=float)
    good = np.isfinite(sinking) & np.isfinite(force) & (sinking > 0) & (force > 0)
    if good.sum() < 2:
        raise ValueError("force-depth calibration needs at least two frames with a positive depth and force")
    sinking, force = sinking[good], force[good]
    compliance = float(sinking @ force / (force @ force))
    residual = sinking - compliance * force
    groups = np.arange(good.sum()) if press is None else np.unique(np.asarray(press)[good], return_inverse=True)[1]
    score = np.bincount(groups, weights=residual * force)
    count = len(score)
    spread = np.sqrt((score**2).sum() * count / max(1, count - 1)) / (force @ force)
    return 1.0 / compliance, float(spread) / compliance**2


def error_surface(
    sensor: Sensor,
    groups: Groups,
    axes_pa: tuple[Array, Array],
    depth_m: Array,
    force_n: Array,
    indenter_n_per_m: float,
) -> ErrorSurface:
    """The paper's Fig. 6: rms of e_ind over a grid of two moduli, from stage depths and forces (N,)."""
    first, second = groups
    sinking = sensor_depth_m(depth_m, force_n, indenter_n_per_m)
    force = np.asarray(force_n, dtype=float)
    rms = np.empty((len(axes_pa[0]), len(axes_pa[1])))
    for i, a in enumerate(axes_pa[0]):
        for j, b in enumerate(axes_pa[1]):
            stiffness = sensor_stiffness_n_per_m(with_moduli(sensor, groups, np.array([a, b])))
            rms[i, j] = np.sqrt(np.nanmean((sinking - force / stiffness) ** 2))
    return ErrorSurface((first, second), axes_pa, rms)


def stiffness_gradient(sensor: Sensor, groups: Groups, moduli_pa: Array) -> tuple[float, Array]:
    """ln k_sen and its derivatives (n,) in the logarithms of the groups' moduli (n,), by central differences."""
    logs = np.log(moduli_pa)

    def log_stiffness(at: Array) -> float:
        return float(np.log(sensor_stiffness_n_per_m(with_moduli(sensor, groups, np.exp(at)))))

    steps = _STEP * np.eye(len(logs))
    return log_stiffness(logs), np.array(
        [(log_stiffness(logs + s) - log_stiffness(logs - s)) / (2 * _STEP) for s in steps]
    )


def fit_moduli(
    sensor: Sensor,
    groups: Groups,
    depth_m: Array,
    force_n: Array,
    indenter_n_per_m: float,
    press: NDArray[np.integer] | None = None,
) -> ModuliFit:
    """The moduli nearest to nominal whose pad has the measured stiffness.

    ``depth_m`` and ``force_n`` (N,) are the stage's depth and the load cell's force of single contacts; ``press`` (N,)
    groups frames that share errors. Raises ``ValueError`` if no frame presses or the stiffness is out of reach.
    """
    stiffness, error = measured_stiffness(depth_m, force_n, indenter_n_per_m, press)
    nominal = {layer.name: layer.youngs_modulus_pa for layer in sensor.layers}
    logs = np.log([nominal[names[0]] for names in groups.values()])
    start = logs.copy()
    for _ in range(_STEPS):
        value, gradient = stiffness_gradient(sensor, groups, np.exp(logs))
        # nearest point to the start on the linearised valley
        gap = np.log(stiffness) - value - gradient @ (start - logs)
        if gradient @ gradient < _INSENSITIVE:
            raise ValueError(f"no moduli of {list(groups)} give the measured stiffness of {stiffness:.4g} N/m")
        step = start + gradient * gap / (gradient @ gradient) - logs
        logs = logs + np.clip(step, -1.0, 1.0)
        if np.abs(step).max() < 1e-9:
            break
    else:
        raise ValueError(f"no moduli of {list(groups)} give the measured stiffness of {stiffness:.4g} N/m")
    _, gradient = stiffness_gradient(sensor, groups, np.exp(logs))
    relative = error / stiffness
    hessian = np.outer(gradient, gradient) / relative**2 if relative > 0 else np.full((len(logs),) * 2, np.inf)
    eigenvalues, eigenvectors = np.linalg.eigh(np.outer(gradient, gradient))
    sinking = sensor_depth_m(depth_m, force_n, indenter_n_per_m)
    misfit = sinking - np.asarray(force_n, dtype=float) / stiffness
    return ModuliFit(
        tuple(groups),
        np.exp(logs),
        stiffness,
        error,
        hessian,
        eigenvalues[::-1] / max(relative, 1e-300) ** 2,
        eigenvectors[:, ::-1],
        relative / float(np.linalg.norm(gradient)),
        float(np.sqrt(np.nanmean(misfit**2))),
    )
