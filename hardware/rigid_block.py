"""Pseudo-indentation of a rigid block: how much the indenter's own support yields (paper III-B, equation 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.failure import LimitExceeded
from ertskin.hardware.indenter import Indenter
from ertskin.hardware.recording import RigidBlock
from ertskin.hardware.samples import mean_force_n


def press_rigid_block(
    indenter: Indenter, depth_m: float = 1e-3, step_m: float = 5e-5, settle_s: float = 0.5
) -> RigidBlock:
    """Press the bench's block in steps down to ``depth_m``; the depth is the stage's, from where force begins.

    The indenter goes up again whatever happens. Raises ``LimitExceeded`` where the bench has no block or a force goes
    beyond its limit.
    """
    block = indenter.rig.geometry.block_m
    if block is None:
        raise LimitExceeded("rigid block: the bench's geometry names none (block_m)")
    x, y, z = block
    limits = indenter.rig.limits
    with indenter.pressing(x, y, z):
        indenter.check_zero()
        indenter.go(x, y, z + limits.approach_m, limits.travel_speed_m_s)
        surface = indenter.touch_off(x, y, z + limits.approach_m)
        depths: NDArray[np.float64] = step_m * np.arange(round(depth_m / step_m) + 1, dtype=float)
        forces = []
        for depth in depths:
            indenter.go(x, y, surface - float(depth), limits.touch_speed_m_s)
            begin = indenter.rig.clock.now()
            indenter.listen(settle_s)
            forces.append(mean_force_n(list(indenter.samples), begin, indenter.rig.clock.now()))
    return RigidBlock(depths, np.array(forces))
