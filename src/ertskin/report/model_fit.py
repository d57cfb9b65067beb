"""What the calibrated model says beside what was measured: the material of the paper's Figs. 4, 6, 7 and 8."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ForceDepth:
    """Measured ``depth_m``, ``force_n``, ``unloading`` (N,); the model's line; the rigid block's points."""

    depth_m: Array
    force_n: Array
    unloading: NDArray[np.bool_] | None = None
    model_depth_m: Array | None = None
    model_force_n: Array | None = None
    rigid_depth_m: Array | None = None
    rigid_force_n: Array | None = None


@dataclass(frozen=True, eq=False)
class SpecimenCurve:
    """The compressometer's points (N,) and the polynomial's line (M,)."""

    stress_pa: Array
    sheet_resistance_ohm_sq: Array
    fit_stress_pa: Array
    fit_sheet_resistance_ohm_sq: Array


@dataclass(frozen=True, eq=False)
class ErrorSurface:
    """Depth error ``error_m`` (A,B) over two moduli (A,), (B,) of the layers ``names``; the best pair."""

    soft_pa: Array
    stiff_pa: Array
    error_m: Array
    best_pa: tuple[float, float]
    names: tuple[str, str]


@dataclass(frozen=True, eq=False)
class RestFit:
    """All R readings at rest: measured, and modelled with the guessed and with the fitted contact resistances."""

    measured_v: Array
    guessed_v: Array
    fitted_v: Array


@dataclass(frozen=True, eq=False)
class ChangeFit:
    """Changes of N one-point frames, measured and modelled (N,R) in volt; ``taxel`` (N,) touched, ``force_n`` (N,)."""

    measured_v: Array
    model_v: Array
    taxel: NDArray[np.intp]
    force_n: Array
    taxel_m: Array

    @property
    def rmse_v(self) -> Array:
        """(N,) root mean square error of each frame over its readings."""
        return np.sqrt(np.mean((self.measured_v - self.model_v) ** 2, axis=1))

    @property
    def rmse_by_taxel_v(self) -> Array:
        """(n,) root mean square over the frames on each taxel; NaN where there is none."""
        square = self.rmse_v**2
        touched = [self.taxel == k for k in range(len(self.taxel_m))]
        return np.array([np.sqrt(square[rows].mean()) if rows.any() else np.nan for rows in touched])


@dataclass(frozen=True, eq=False)
class ModelFit:
    """The parts a recording could say something about; ``noise_v``: standard deviation of one reading."""

    force_depth: ForceDepth | None = None
    specimen: SpecimenCurve | None = None
    error_surface: ErrorSurface | None = None
    rest: RestFit | None = None
    change: ChangeFit | None = None
    noise_v: float | None = None
