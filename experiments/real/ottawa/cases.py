"""The simulated cases: tanks as their file says, with and without a fault, squeezed ones, ones with an electrode moved.

Every number is drawn by the case's number; what is learned from even numbers is judged on odd ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from simulated import ELECTRODES, RADIUS_M, Fault, Tank, beyond_disk_maps, hand_made

from ertskin.diagnosis.tank import diagnosis as tank
from ertskin.diagnosis.tank.displaced_electrodes import placed
from ertskin.diagnosis.tank.electrode_error import (
    LEVEL,
    channel_errors,
    column_errors,
    corrected,
    electrode_errors,
    rms_v,
)
from ertskin.physics.spikes import completed

NULLS = ("null", "null, faulty electrode", "null, something inside")
KINDS = (*NULLS, "squeezed", "squeezed, faulty electrode", "one moved")


def case(kind: str, number: int) -> Tank:
    """A tank of a kind."""
    draw = np.random.default_rng([KINDS.index(kind), number, 7])
    seed = 1000 * KINDS.index(kind) + number
    fault, given = Fault(), {}
    if "faulty electrode" in kind:
        gain, offset = draw.choice([-1, 1], 2) * (10 ** draw.uniform([-2, -2], [0, -0.5])) * draw.permutation([1, 0])
        fault = Fault(electrode=int(draw.integers(ELECTRODES)), gain=float(gain), offset=float(offset))
    if "inside" in kind:
        distance, angle = draw.uniform(0, 0.6), draw.uniform(0, 2 * np.pi)
        where = (distance * np.cos(angle), distance * np.sin(angle), draw.uniform(0.05, 0.2))
        fault = Fault(inside=where, contrast=float(10 ** draw.uniform(-2, 2)))
    if "squeezed" in kind:
        given = {"squeeze": float(draw.uniform(0.02, 0.2)), "lobes": int(draw.choice([2, 2, 2, 3]))}
    if kind == "one moved":
        given = {"moved": ((int(draw.integers(ELECTRODES)), float(draw.choice([-1, 1]) * draw.uniform(0.05, 0.25))),)}
    return hand_made(seed, fault=fault, **given)


def seen(made: Tank) -> dict[str, Any]:
    """What the diagnosis measures of a tank, before any threshold, beside the truth."""
    recording = made.recording()
    protocol, frames = recording.protocol, recording.frames
    assert recording.sensor is not None
    assert protocol is not None
    assert frames is not None
    voltage = completed(protocol, np.asarray(frames.voltage_v, dtype=float))
    scan, size = voltage[0], float(np.sqrt(np.mean(voltage[0][protocol.taken] ** 2)))
    electrodes, channels = (test(protocol, scan, LEVEL / 2) for test in (electrode_errors, channel_errors))
    columns = {
        key: [c for w in errors.weights(protocol) for c in column_errors(protocol, scan, w)]
        for key, errors in (("electrodes", electrodes), ("channels", channels))
    }
    wrong, noise = tank.blamed(protocol, scan), tank.noise_v(protocol, voltage)
    mended = scan
    for weight in wrong.weights(protocol):
        mended = corrected(protocol, mended, weight)
    found = placed(recording, mended, noise, wrong)
    assert found is not None
    return {
        "true_shift": made.disk_shifts().tolist(),
        "placed": beyond_disk_maps(made.places()).tolist() if made.squeeze == 0 else None,
        "shift": (found.shift_m / RADIUS_M).tolist(),
        "error": (found.error_m / RADIUS_M).tolist(),
        "before": found.misfit_before,
        "after": found.misfit_after,
        "blamed": list(wrong.named),
        "blamed_channels": wrong.channels,
        "p_value": list(wrong.p_value),
        "named_by_chance": [list(electrodes.named), list(channels.named)],
        "left": [electrodes.left_v / size, channels.left_v / size],
        "largest": {
            key: max((max(abs(c.gain), abs(c.offset_v) / size) for c in found), default=0.0)
            for key, found in columns.items()
        },
        "unexplained": rms_v(protocol, scan) / size,
        "noise": noise / size,
        "fault": made.fault.electrode,
        "gain": made.fault.gain,
        "offset": made.fault.offset,
        "squeeze": made.squeeze,
        "instrument": made.gain,
    }
