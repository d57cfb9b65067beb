"""What no sound recording holds: the one check behind ``doctor`` and every command that reads recordings.

``plausibility`` asks whether values are in SI units; here they are held against one another and against stated limits.
"""

from __future__ import annotations

from collections.abc import Iterator

from ertskin.hardware.measurement import Recording
from ertskin.hardware.plausibility import Doubt
from ertskin.hardware.soundness.bench_tests import block_faults, coupon_faults, specimen_faults
from ertskin.hardware.soundness.electrodes import electrode_faults
from ertskin.hardware.soundness.pad import pad_faults
from ertskin.hardware.soundness.presses import press_faults
from ertskin.hardware.soundness.readings import reading_faults
from ertskin.hardware.soundness.scan import scan_faults
from ertskin.hardware.soundness.sheet import sheet_faults


def faults(recording: Recording) -> Iterator[Doubt]:
    """Everything that makes a recording unusable, what others build on first."""
    if recording.sensor is not None:
        yield from sheet_faults(recording.sensor)
        yield from electrode_faults(recording.sensor)
        yield from pad_faults(recording.sensor)
    if recording.protocol is not None:
        yield from scan_faults(recording.protocol)
    if recording.frames is not None:
        yield from press_faults(recording)
        yield from reading_faults(recording)
    if recording.specimen is not None:
        yield from specimen_faults(recording.specimen)
    if recording.rigid_block is not None:
        yield from block_faults(recording.rigid_block)
    if recording.coupon is not None:
        yield from coupon_faults(recording.coupon)
