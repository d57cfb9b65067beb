"""Stiffness of the indenter's support from the pseudo-indentation of a rigid block (paper III-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.calibration.robust_line import RobustLine

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IndenterSupport:
    """k_ind in newton per metre with its standard error, the load cell's offset and scatter in newton."""

    stiffness_n_per_m: float
    standard_error_n_per_m: float
    force_offset_n: float
    force_noise_n: float


def indenter_support(depth_m: Array, force_n: Array) -> IndenterSupport:
    """k_ind, the slope of force (N,) in newton against commanded depth (N,) in metre on a rigid block.

    The paper divides force by depth; a robust line does the same with the load cell's offset fitted and outliers bent
    down. Raises ``ValueError`` on too few points or a slope that is not positive.
    """
    line = RobustLine.fit(depth_m, force_n)
    if line.slope <= 0:
        raise ValueError(f"the rigid block's force must rise with depth; its slope is {line.slope:.4g} N/m")
    return IndenterSupport(line.slope, line.slope_standard_error, line.intercept, line.sigma)
