"""The tests beside the skin: specimen, rigid block and foam coupon."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ertskin.hardware.measurement import Coupon, RigidBlock, Specimen
from ertskin.hardware.plausibility import Doubt
from ertskin.hardware.soundness.presses import backwards, negated

LEAST_STRESSES = 6
"""Different stresses that fix a fifth-order law."""


def specimen_faults(specimen: Specimen) -> Iterator[Doubt]:
    """What is wrong with a specimen's test."""
    different = len(np.unique(specimen.stress_pa))
    if different < LEAST_STRESSES:
        found = f"{different} different stresses in {len(specimen.stress_pa)} points"
        yield Doubt("/specimen/stress_pa", found, f"{LEAST_STRESSES} at least")
        return
    yield from negated("/specimen/stress_pa", specimen.stress_pa, "compression is positive")
    yield from backwards("/specimen/time_s", specimen.time_s)


def block_faults(block: RigidBlock) -> Iterator[Doubt]:
    """What is wrong with a rigid block's test: it must show a stiffness."""
    if len(block.depth_m) < 2 or np.ptp(block.depth_m) == 0.0:
        found = f"{len(block.depth_m)} points at {len(np.unique(block.depth_m))} depths"
        yield Doubt("/rigid_block/depth_m", found, "two depths at least")
        return
    depth, force = block.depth_m - block.depth_m.mean(), block.force_n - block.force_n.mean()
    slope = float(depth @ force / (depth @ depth))
    scatter = force - slope * depth
    error = float(np.sqrt(scatter @ scatter / max(1, len(depth) - 2) / (depth @ depth)))
    if slope <= 2.0 * error:
        found = f"a force that does not rise with depth (slope {slope:.4g} N/m)"
        yield Doubt("/rigid_block/force_n", found, "one that rises: the slope is the stiffness of the support")


def coupon_faults(coupon: Coupon) -> Iterator[Doubt]:
    """What is wrong with a coupon's test."""
    if len(coupon.time_s) < 2:
        yield Doubt("/coupon/time_s", f"{len(coupon.time_s)} samples", "two at least")
        return
    yield from backwards("/coupon/time_s", coupon.time_s)
    yield from negated("/coupon/force_n", coupon.force_n, "compression is positive")
    if coupon.gap_m.min() <= 0.0 or np.ptp(coupon.gap_m) == 0.0:
        found = f"gaps from {coupon.gap_m.min():.3g} to {coupon.gap_m.max():.3g} m"
        yield Doubt("/coupon/gap_m", found, "positive gaps that change")
