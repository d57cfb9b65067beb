"""The scan: not more than can be worked with, and more than one injection."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ertskin.hardware.plausibility import Doubt
from ertskin.physics.protocol import Protocol

MOST_PRODUCTS = 5 * 10**7
"""Readings of a scan times pairs of electrodes: the size of the matrix between them, which is half of what is held."""


def oversized(electrodes: int, injections: int, readings: int) -> Doubt | None:
    """What speaks against working with so large a scan, or None; asked before anything of that size is made."""
    products = injections * readings * (electrodes * (electrodes - 1) // 2)
    if products <= MOST_PRODUCTS:
        return None
    found = f"{injections} injections, {readings} readings each, between {electrodes} electrodes"
    return Doubt("/protocol", found, f"readings times pairs of electrodes up to {MOST_PRODUCTS:g}, not {products:g}")


def scan_faults(protocol: Protocol) -> Iterator[Doubt]:
    """What is wrong with the injections."""
    current = protocol.injection_current_a
    if not np.isfinite(current).all():
        yield Doubt("/protocol/injection_current_a", "currents NaN or infinite", "finite numbers")
        return
    idle = np.flatnonzero(~current.any(axis=1))
    if len(idle):
        yield Doubt("/protocol/injection_current_a", f"injection {idle[0]} without a current", "a current in each")
    if len(current) > 1 and (current == current[0]).all():
        found = f"{len(current)} injections, all alike"
        yield Doubt("/protocol/injection", found, "injections between different electrodes")
