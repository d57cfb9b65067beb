"""How much of two faces touches under a pressure."""

from __future__ import annotations

import numpy as np

from ertskin.physics.effects.effect import Array

EVEN = 1e-6
"""Unevenness up to which gaps are as good as even."""


def touching_share(pressure_pa: Array, half_pa: float, unevenness: float = 0.0) -> Array:
    """(T,N) share of the gaps that close under pressures (T,N), half of them at ``half_pa``.

    Gaps of exponentially distributed widths: 1 - 2^(-p/half), Greenwood & Williamson, Proc. R. Soc. A 295 (1966) 300;
    with ``unevenness`` u, their mean's variance over its square, 1 - (1 + (2^u - 1) p/half)^(-1/u).
    """
    # In place, and without exp2 and powers, which numpy computes one at a time.
    share = np.maximum(pressure_pa, 0.0)
    if unevenness > EVEN:
        share *= (2**unevenness - 1.0) / half_pa
        np.log1p(share, out=share)
        share /= -unevenness
    else:
        share *= -np.log(2.0) / half_pa
    np.exp(share, out=share)
    return np.subtract(1.0, share, out=share)
