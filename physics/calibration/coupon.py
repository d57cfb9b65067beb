"""Young's modulus of a foam coupon squeezed between plates: the slope of stress against strain as it is loaded.

The strain is the plates' approach over the coupon's height; the first few percent are the faces settling, so the slope
is taken over a window beyond them. With free sides it is Young's modulus, with confined sides the oedometric modulus,
E (1-nu)/((1+nu)(1-2nu)). Foams are softer after their first loading, which is reported apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.calibration.robust_line import RobustLine

Array = NDArray[np.float64]

_FEWEST = 20


@dataclass(frozen=True)
class CouponModulus:
    """Young's modulus in pascal at small strain.

    ``first_pa`` of the first loading; ``cycled_pa`` the mean of the later ones with its standard error from their
    scatter (NaN with fewer than two); ``settling_strain`` where the first loading's line meets zero stress.
    ``loadings`` counts them all.
    """

    first_pa: float
    cycled_pa: float
    cycled_standard_error_pa: float
    settling_strain: float
    loadings: int


def coupon_modulus(
    time_s: Array,
    gap_m: Array,
    force_n: Array,
    height_m: float,
    area_m2: float,
    lateral: str,
    poissons_ratio: float = 0.3,
    strain_window: tuple[float, float] = (0.03, 0.08),
) -> CouponModulus:
    """Modulus from a record of gap and compressive force (N,).

    ``lateral`` is "free" or "confined"; ``poissons_ratio`` matters for confined sides only. Raises ``ValueError`` if no
    loading crosses the strain window or ``lateral`` is unknown.
    """
    if lateral not in ("free", "confined"):
        raise ValueError(f"lateral must be 'free' or 'confined', not {lateral!r}")
    order = np.argsort(time_s, kind="stable")
    strain = 1 - np.asarray(gap_m, dtype=float)[order] / height_m
    stress = np.asarray(force_n, dtype=float)[order] / area_m2
    good = np.isfinite(strain) & np.isfinite(stress)
    lines = [RobustLine.fit(strain[k], stress[k]) for k in _loadings(strain, good, strain_window)]
    if not lines:
        raise ValueError(f"no loading crosses the strains {strain_window[0]:g} to {strain_window[1]:g}")
    nu = poissons_ratio
    to_young = 1.0 if lateral == "free" else (1 + nu) * (1 - 2 * nu) / (1 - nu)
    later = to_young * np.array([line.slope for line in lines[1:]])
    return CouponModulus(
        to_young * lines[0].slope,
        float(later.mean()) if len(later) else float("nan"),
        float(later.std(ddof=1) / np.sqrt(len(later))) if len(later) > 1 else float("nan"),
        -lines[0].intercept / lines[0].slope,
        len(lines),
    )


def _loadings(strain: Array, good: NDArray[np.bool_], window: tuple[float, float]) -> list[NDArray[np.intp]]:
    """Samples within the window of every passage from below it to above it."""
    low, high = window
    passages, began = [], None
    for k in np.flatnonzero(good):
        if strain[k] < low:
            began = k + 1
        elif strain[k] > high and began is not None:
            inside = np.arange(began, k)
            inside = inside[good[inside]]
            if len(inside) >= _FEWEST:
                passages.append(inside)
            began = None
    return passages
