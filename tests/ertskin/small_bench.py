"""Recordings of a small skin on the virtual bench: whole ones, with everything a command may ask for, in a second."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ertskin.hardware.recording import Recording, write_recording
from ertskin.hardware.virtual.bench import FAST
from ertskin.hardware.virtual.bench.bench import CREATED, Bench
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.hardware.virtual.bench.plans import presses
from ertskin.hardware.virtual.bench.truth import Truth, draw_truth
from ertskin.physics.history import History, Phase
from ertskin.physics.sensor import Sensor, rectangle_m, taxel_grid_m

SIDE_M = 0.06
LINE_M = np.array([0.006, 0.03, 0.054])
CORNERS_AND_MIDDLE = (0, 2, 4, 6, 8, 4)
EVERY_TAXEL_THREE_TWICE = (*CORNERS_AND_MIDDLE[:5], 1, 5, 7, 3, 4, 0, 8)
WEIGHT_N = 3.0


def small_bench_sensor() -> Sensor:
    """The paper's pad under a sheet of 60 mm with eight electrodes around and nine taxels."""
    x, y = (axis.ravel() for axis in np.meshgrid(LINE_M, LINE_M))
    around = np.arange(9) != 4
    layers = nominal_sensor()
    return Sensor(
        rectangle_m((SIDE_M, SIDE_M)),
        electrode_center_m=np.stack([x, y], axis=1)[around],
        electrode_size_m=np.full((8, 2), 4e-3),
        taxel_m=taxel_grid_m((SIDE_M, SIDE_M), 3, 3),
        layers=layers.layers,
        piezo_interface=layers.piezo_interface,
        sheet_resistance_ohm_sq=layers.sheet_resistance_ohm_sq,
        indenter_diameter_m=layers.indenter_diameter_m,
        indenter_points_m=layers.indenter_points_m,
        pad_margin_m=layers.pad_margin_m,
    )


def write_small_bench(folder: Path, effects: Mapping[str, float] | None = None, seed: int = 3) -> tuple[Path, ...]:
    """``train.h5``, six presses, and the tests ``one.h5``, three presses, and ``two.h5``, two pairs of weights."""
    bench = small_bench(effects or {}, seed)
    sensor = bench.sensor
    plans = {
        "train": presses(sensor.taxel_m[list(CORNERS_AND_MIDDLE)], 1e-3 * np.arange(1.0, 4.0), holds=1),
        "one": presses(sensor.taxel_m[[1, 4, 7]], np.array([1.5e-3, 2.5e-3]), holds=0, unloading=False),
        "two": _pairs_of_weights(sensor),
    }
    paths = []
    for name, history in plans.items():
        paths.append(folder / f"{name}.h5")
        write_recording(paths[-1], _recorded(bench, name, history))
    return tuple(paths)


def twelve_presses(effects: Mapping[str, float], seed: int) -> tuple[Recording, Truth]:
    """What a diagnosis needs, every taxel pressed and three of them twice, and what is hidden in it."""
    bench = small_bench(effects, seed)
    places = bench.sensor.taxel_m[list(EVERY_TAXEL_THREE_TWICE)]
    history = presses(places, 1e-3 * np.arange(1.0, 5.0), holds=1)
    return _recorded(bench, "train", history), bench.truth


def small_bench(effects: Mapping[str, float], seed: int) -> Bench:
    """The small skin of a seed with these effects on the bench."""
    sensor = small_bench_sensor()
    return Bench(draw_truth(sensor, seed, dict(effects)), sensor, nominal_protocol(sensor), FAST)


def _recorded(bench: Bench, name: str, history: History) -> Recording:
    frames, block, specimen = bench.frames(history, name), bench.rigid_block(), bench.specimen(cycles=2)
    return Recording(f"small_{bench.truth.seed}", CREATED, name, bench.sensor, bench.protocol, frames, specimen, block)


def _pairs_of_weights(sensor: Sensor) -> History:
    contact = np.full((4, 2, 2), np.nan)
    contact[1], contact[2] = sensor.taxel_m[[0, 8]], sensor.taxel_m[[2, 6]]
    touched = np.isfinite(contact[..., 0])
    phase = np.where(touched.any(axis=1), Phase.HOLD, Phase.REST).astype(np.uint8)
    force = np.where(touched, WEIGHT_N, np.nan)
    return History(20.0 * np.arange(4.0), np.arange(4), phase, contact, np.full((4, 2), np.nan), force)
