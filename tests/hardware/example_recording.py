"""A small whole recording, and equality to the last bit."""

from __future__ import annotations

import dataclasses

import numpy as np

from hardware.recording import Coupon, Frames, Recording, RigidBlock, Specimen
from physics.history import History
from physics.protocol import Protocol, electrode_pairs
from physics.sensor import Layer, Sensor, four_points_m, rectangle_m, taxel_grid_m


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
    count = random.integers(0, 50_000, (5, 6, 4), dtype=np.int32)
    contact = np.full((5, 1, 2), np.nan)
    contact[1:4] = 0.03
    depth = np.array([np.nan, 1e-3, 2e-3, 1e-3, np.nan])[:, None]
    history = History(
        10.0 + 0.5 * np.arange(5),
        np.array([0, 0, 0, 0, 1]),
        np.array([0, 1, 2, 3, 0], dtype=np.uint8),
        contact,
        depth,
        random.normal(size=(5, 1)),
    )
    frames = Frames((count * 1e-4).astype(np.float32), history, count if adc else None)
    times = np.arange(8.0)
    return Recording(
        "bench", "2026-01-01T00:00:00Z", "an example", sensor, protocol, frames,
        Specimen(1e3 * times, 18e3 - 1e3 * times, times, np.arange(8) // 4),
        RigidBlock(1e-5 * times, 0.09 * times),
        Coupon(times, 0.01 - 1e-4 * times, times, 0.01, 5e-5, "free", 1.0),
    )  # fmt: skip


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
