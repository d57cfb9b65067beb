"""What was recorded: the sensor, the presses, the readings."""

from __future__ import annotations

import numpy as np

from ertskin.hardware.measurement import Recording
from ertskin.report.figures.recording_timeline import recording_timeline
from ertskin.report.figures.sensor_layout import sensor_layout
from ertskin.report.page import Picture, Section


def recorded(recordings: dict[str, Recording]) -> Section:
    """Facts and pictures of the recordings, each under the name it plays here, such as "one-point test"."""
    facts, pictures = [], []
    first = next(iter(recordings.values()), None)
    if first is not None and first.sensor is not None:
        sensor = first.sensor
        low_mm, high_mm = 1e3 * sensor.extent_m
        size = " × ".join(f"{side:.3g}" for side in high_mm - low_mm)
        facts.append(("sensor", f"{size} mm, {sensor.electrodes} electrodes, {len(sensor.taxel_m)} sensing points"))
        pictures.append(
            Picture.of(sensor_layout(sensor), "The sensor from above: electrodes with their numbers, taxels.")
        )
    for role, recording in recordings.items():
        if recording.frames is None:
            continue
        history = recording.frames.history
        force_n = np.nansum(history.force_n, axis=1)
        presses = len(np.unique(history.press[history.touched.any(axis=1)]))
        facts.append(
            (
                role,
                f"{recording.rig}: {len(history)} frames, {presses} presses, up to {force_n.max():.1f} N, "
                f"{np.ptp(history.time_s) / 60:.1f} min",
            )
        )
        pictures.append(
            Picture.of(_timeline(recording), f"{role.capitalize()}: force and readings along time.", wide=True)
        )
    words = (
        "Presses at known places with known forces, and all potentials of every scan. Changes are counted from the "
        "frames at rest around each press.",
    )
    return Section("What was recorded", words, tuple(facts), pictures=tuple(pictures))


def _timeline(recording: Recording):
    assert recording.frames is not None
    voltage_v, history = recording.frames.voltage_v, recording.frames.history
    rest = np.flatnonzero(history.phase == 0)
    zero_v = voltage_v[rest[0] if len(rest) else 0]
    change_v = np.array([np.sqrt(np.nanmean((scan - zero_v) ** 2)) for scan in voltage_v], dtype=float)
    return recording_timeline(history.time_s, np.nansum(history.force_n, axis=1), change_v, history.phase)
