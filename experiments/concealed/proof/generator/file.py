"""The recording file, version 1, as its format's description says; the same recording gives the same bytes."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np

from .recording import Measured
from .skin import Skin

LAYER = np.dtype([("name", "S32"), ("thickness_m", "<f8"), ("youngs_modulus_pa", "<f8"), ("poissons_ratio", "<f8")])


def write(path: Path, skin: Skin, measured: Measured, rig: str) -> None:
    """Write aside, then rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    with h5py.File(aside, "w") as file:
        for key, value in {
            "format": "ert-tactile-recording", "format_version": 1, "rig": rig,
            "created": "2026-11-22T00:00:00Z", "comment": "",
        }.items():  # fmt: skip
            file.attrs[key] = value
        _sensor(file.create_group("sensor"), skin)
        _protocol(file.create_group("protocol"), skin)
        for name, columns in (("specimen", measured.specimen), ("rigid_block", measured.block)):
            group = file.create_group(name)
            for key, column in columns.items():
                group[key] = column
        _frames(file.create_group("frames"), measured)
    os.replace(aside, path)


def _sensor(group: h5py.Group, skin: Skin) -> None:
    low, high = skin.box_m
    if len(skin.outline_m) == 4 and not low.any():
        group.attrs["size_m"] = high
    else:
        group["outline_m"] = skin.outline_m
    group.attrs["sheet_resistance_ohm_sq"] = skin.said.get("sheet_ohm", skin.sheet_ohm)
    group.attrs["contact_resistance_guess_ohm"] = skin.said.get("contact_ohm", 10.0)
    group.attrs["indenter_diameter_m"] = skin.diameter_m
    group.attrs["piezo_interface"] = skin.interface
    group.attrs["pad_margin_m"] = skin.margin_m
    nominal = [skin.said.get(layer.name, layer.youngs_modulus_pa) for layer in skin.layers]
    rows = [(x.name.encode(), x.thickness_m, e, x.poissons_ratio) for x, e in zip(skin.layers, nominal, strict=True)]
    group["layers"] = np.array(rows, dtype=LAYER)
    if skin.electrodes.edge_m is not None:
        group["electrode_edge_m"] = skin.electrodes.edge_m
    else:
        group["electrode_center_m"] = skin.electrodes.center_m
        group["electrode_size_m"] = skin.electrodes.size_m
    group["taxel_m"] = skin.taxel_m
    group["indenter_points_m"] = skin.points_m


def _protocol(group: h5py.Group, skin: Skin) -> None:
    protocol = skin.protocol
    group["injection"] = protocol.injection.astype(np.int16)
    group.attrs["current_a"] = protocol.current_a
    if protocol.read is None:
        group.attrs["reference"] = "sink"
    else:
        group["measurement"] = protocol.read.astype(np.int16)
    if protocol.measured is not None:
        group["measured"] = protocol.measured
    group["injection_offset_s"] = protocol.offset_s
    group.attrs["scan_s"] = protocol.scan_s
    group.attrs["adc_volts_per_count"] = protocol.adc_volts_per_count
    group.attrs["adc_limit_v"] = protocol.adc_limit_v


def _frames(group: h5py.Group, measured: Measured) -> None:
    voltage, frames = measured.voltage_v, measured.frames
    group.create_dataset("voltage_v", data=voltage, chunks=(1, *voltage.shape[1:]), compression="gzip", shuffle=True)
    group["time_s"], group["press"], group["phase"] = frames.time_s, frames.press, frames.phase
    group["contact_m"], group["depth_m"] = frames.contact_m, frames.depth_m
    group["force_n"] = measured.force_n
