"""A mapping: which entry of a file is which field of a recording. The YAML a person writes, read and followed."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ertskin.errors import UserError
from ertskin.hardware.description import DescriptionError, protocol_of, sensor_of
from ertskin.hardware.measurement import Coupon, Frames, Recording, RigidBlock, Specimen
from ertskin.importing.columns import columns, times_s
from ertskin.importing.eidors import eidors_model
from ertskin.importing.entry import Source
from ertskin.importing.frames import frames_of
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Part = dict[str, Any]
PARTS = ("rig", "comment", "eidors", "sensor", "protocol", "frames", "specimen", "rigid_block", "coupon")


def read_mapping(path: Path) -> Part:
    """The mapping's parts; raises ``UserError`` for a file that is none, or names a part that recordings don't have."""
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such mapping; write one with: ertskin import --template source=FILE") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UserError(f"{path}: can't be read as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(found, dict):
        raise UserError(f"{path}: holds no mapping; write one with: ertskin import --template source=FILE")
    parts = {name: part for name, part in found.items() if part is not None}
    if unknown := [str(name) for name in parts if name not in PARTS]:
        raise UserError(f"{path}: unknown part {', '.join(unknown)}; there are {', '.join(PARTS)}")
    for name, part in parts.items():
        if name not in ("rig", "comment") and not isinstance(part, dict):
            raise UserError(f"{path}: {name}: found {part!r}, expected its fields below it")
    return parts


def recording_of(path: Path, mapping: Path) -> Recording:
    """The recording that ``mapping`` makes of the file at ``path``; raises ``UserError`` naming part and field."""
    parts = read_mapping(mapping)
    source = Source(path, mapping)
    sensor, protocol = _described(parts, source)
    found = {name: source.value(parts[name], name) for name in ("specimen", "rigid_block", "coupon") if name in parts}
    return Recording(
        rig=str(parts.get("rig", path.stem)),
        created=f"{datetime.fromtimestamp(path.stat().st_mtime, UTC):%Y-%m-%dT%H:%M:%SZ}",
        comment=str(parts.get("comment", f"imported from {path.name}")),
        sensor=sensor,
        protocol=protocol,
        frames=_frames(parts, source, protocol),
        specimen=_specimen(found["specimen"], source) if "specimen" in found else None,
        rigid_block=_rigid_block(found["rigid_block"], source) if "rigid_block" in found else None,
        coupon=_coupon(found["coupon"], source) if "coupon" in found else None,
    )


def _described(parts: Part, source: Source) -> tuple[Sensor | None, Protocol | None]:
    """What an EIDORS structure tells, and on top of it what the mapping says itself."""
    sensor_fields = source.value(parts.get("sensor", {}), "sensor")
    protocol = None
    if "eidors" in parts:
        geometry, protocol = eidors_model(parts["eidors"], source)
        sensor_fields = geometry | sensor_fields
    try:
        sensor = sensor_of(sensor_fields) if sensor_fields else None
        if "protocol" in parts:
            fields = source.value(parts["protocol"], "protocol")
            protocol = _protocol(fields, protocol, sensor, source)
    except DescriptionError as error:
        raise UserError(f"{source.mapping}: {error}") from None
    return sensor, protocol


def _protocol(fields: Part, known: Protocol | None, sensor: Sensor | None, source: Source) -> Protocol:
    electrodes = fields.pop("electrodes", None) or (sensor.electrodes if sensor is not None else None)
    fields = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in fields.items()}
    # MATLAB counts from 1, a recording from 0.
    base = int(fields.pop("counted_from", 0))
    for key in ("injection", "measurement"):
        if isinstance(fields.get(key), list):
            fields[key] = np.asarray(fields[key], dtype=int) - base
    if known is None:
        if electrodes is None:
            raise source.refuse("protocol.electrodes", "how many electrodes there are must be given, or a sensor")
        return protocol_of(fields, int(electrodes))
    extra = {key: fields.pop(key) for key in ("scan_s", "adc_volts_per_count", "adc_limit_v") if key in fields}
    if fields:
        raise source.refuse("protocol", f"{', '.join(fields)}: the EIDORS structure tells that already")
    return replace(known, **extra)


def _frames(parts: Part, source: Source, protocol: Protocol | None) -> Frames | None:
    if "frames" not in parts:
        return None
    if protocol is None:
        raise source.refuse("protocol", "missing: what a reading means must be told")
    return frames_of(source.value(parts["frames"], "frames"), protocol, source)


def _specimen(fields: Part, source: Source) -> Specimen:
    stress, resistance = columns(fields, ("stress_pa", "sheet_resistance_ohm_sq"), "specimen", source)
    cycle = np.asarray(fields.get("cycle", np.zeros(len(stress)))).astype(np.int64)
    return Specimen(stress, resistance, times_s(fields, len(stress), "specimen", source), cycle)


def _rigid_block(fields: Part, source: Source) -> RigidBlock:
    return RigidBlock(*columns(fields, ("depth_m", "force_n"), "rigid_block", source))


def _coupon(fields: Part, source: Source) -> Coupon:
    gap, force = columns(fields, ("gap_m", "force_n"), "coupon", source)
    for name in ("height_m", "area_m2", "lateral"):
        if name not in fields:
            raise source.refuse(f"coupon.{name}", "missing")
    height, area = float(fields["height_m"]), float(fields["area_m2"])
    return Coupon(times_s(fields, len(gap), "coupon", source), gap, force, height, area, str(fields["lateral"]))
