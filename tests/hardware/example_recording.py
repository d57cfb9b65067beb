"""A small whole recording, and equality to the last bit."""

from __future__ import annotations

import dataclasses

import numpy as np

from ertskin.hardware.recording import Coupon, Frames, Recording, RigidBlock, Specimen
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances
from ertskin.physics.sensor import Layer, Sensor, four_points_m, rectangle_m, taxel_grid_m


def example(seed: int = 0, adc: bool = True) -> Recording:
    """A small whole recording with every part."""
    random = np.random.default_rng(seed)
    corners = np.array([[0.01, 0.01], [0.09, 0.01], [0.01, 0.05], [0.09, 0.05]])
    sensor = Sensor(
        rectangle_m((0.1, 0.06)),
        18e3,
        10.0,
        corners,
        np.full((4, 2), 4e-3),
        taxel_m=taxel_grid_m((0.1, 0.06), 3, 2),
        layers=(Layer("foam", 4e-3, 28e3, 0.3), Layer("fabric", 4e-4, 344e3, 0.4)),
        indenter_points_m=four_points_m(0.01),
        pad_margin_m=0.02,
    )
    pairs = electrode_pairs(4)
    protocol = Protocol.against_sink(
        pairs, 4, 1e-4, injection_offset_s=np.arange(6) * 0.05, scan_s=0.3, adc_volts_per_count=1e-4, adc_limit_v=10.0
    )
    count = _counts(random, protocol)
    contact = np.full((5, 1, 2), np.nan)
    contact[1:4] = 0.03
    depth = np.array([np.nan, 1e-3, 2e-3, 1e-3, np.nan])[:, None]
    history = History(
        10.0 + 0.5 * np.arange(5),
        np.array([0, 0, 0, 0, 1]),
        np.array([0, 1, 2, 3, 0], dtype=np.uint8),
        contact,
        depth,
        np.array([0.01, 1.0, 2.0, 0.9, -0.01])[:, None] + 1e-3 * random.normal(size=(5, 1)),
    )
    frames = Frames((count * 1e-4).astype(np.float32), history, count if adc else None)
    times = np.arange(8.0)
    return Recording(
        "bench", "2026-01-01T00:00:00Z", "an example", sensor, protocol, frames,
        Specimen(1e3 * times, 18e3 - 1e3 * times, times, np.arange(8) // 4),
        RigidBlock(1e-5 * times, 0.09 * times),
        Coupon(times, 0.01 - 1e-4 * times, times, 0.01, 5e-5, "free", 1.0),
    )  # fmt: skip


def undriven(electrodes: int) -> Recording:
    """A tank read in the adjacent scheme, the driven electrodes not read, one reading lost."""
    angle = 2 * np.pi * np.arange(2 * electrodes) / (2 * electrodes)
    outline = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    sensor = Sensor(outline, electrode_edge_m=np.stack([outline[::2], outline[1::2]], axis=1))
    number = np.arange(electrodes)
    after = (number + 1) % electrodes
    reads = np.stack([number, after], axis=1)
    measured = ~(reads[None, :, :, None] == reads[:, None, None, :]).any(axis=(2, 3))
    current = 1e-3 * (np.eye(electrodes) - np.eye(electrodes)[after])
    protocol = Protocol.differences(current, reads, measured=measured)
    voltage = np.random.default_rng(0).normal(size=(2, electrodes, electrodes)).astype(np.float32)
    voltage[:, ~measured] = np.nan
    voltage[1, 0, 3] = np.nan
    nothing = np.zeros((2, 0))
    history = History(
        np.arange(2.0), np.zeros(2, np.int64), np.zeros(2, np.uint8), np.zeros((2, 0, 2)), nothing, nothing
    )
    return Recording("tank", "", "", sensor, protocol, Frames(voltage, history))


def _counts(random: np.random.Generator, protocol: Protocol) -> np.ndarray:
    """(5,6,4) converter's counts of a random passive network that changes a little from frame to frame."""
    root = random.normal(size=(4, 4)) + 2.0 * np.eye(4)
    transfer = [2e3 * (1.0 + 0.05 * frame) * root @ root.T for frame in range(5)]
    voltage = protocol.readings(np.stack([pair_resistances(t) for t in transfer]))
    return np.asarray(np.clip(np.round(voltage / 1e-4), 0, 100_000), dtype=np.int32)


def assert_same(one: object, other: object, name: str = "recording") -> None:
    """Equal to the last bit, NaN and dtype included."""
    if dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name), f"{name}.{field.name}")
    elif isinstance(one, np.ndarray):
        assert isinstance(other, np.ndarray), name
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes()), name
    else:
        assert one == other, name
