"""The recording file, version 1: read, refuse, write. One HDF5 file is one run of measurements on one sensor.

The reader takes what it can interpret and refuses the rest with one line naming the file, the field, what was found and
what was expected. Fields it does not know are left alone. A file whose writer was killed (``recorder``) reads up to its
last whole frame.
"""

from __future__ import annotations

import os
import tempfile
from itertools import chain
from pathlib import Path
from typing import cast

import h5py
import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.clean_copy import CannotOpen, CannotRead, clean_copy
from ertskin.hardware.fields import Fields, first_line
from ertskin.hardware.isolation import isolated_copy
from ertskin.hardware.measurement import (
    Array,
    Coupon,
    Frames,
    Recording,
    RecordingError,
    RigidBlock,
    Specimen,
)
from ertskin.hardware.plausibility import doubts
from ertskin.hardware.soundness import faults
from ertskin.hardware.soundness.pad import MOST_LAYERS
from ertskin.hardware.soundness.scan import oversized
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Layer, Sensor, four_points_m, rectangle_m

FORMAT = "ert-tactile-recording"
FORMAT_VERSION = 1
UNFINISHED = "unfinished"
"""Attribute of /frames while a recorder is still appending: its columns may differ by the frame being written."""
LAYER_DTYPE = np.dtype(
    [("name", "S32"), ("thickness_m", "<f8"), ("youngs_modulus_pa", "<f8"), ("poissons_ratio", "<f8")]
)

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "Coupon",
    "Frames",
    "Recording",
    "RecordingError",
    "RigidBlock",
    "Specimen",
    "read_recording",
    "read_segmentation",
    "read_with_state",
    "write_recording",
]


def read_recording(path: str | Path, *, isolated: bool = True, sound: bool = True) -> Recording:
    """The recording in the file at ``path``; raises ``RecordingError`` for anything that is not a whole, sane one.

    ``isolated``: take the file apart in a process of its own, which damaged bytes may hang or crash; a file that this
    program has written itself needs none. ``sound``: refuse what no sound recording holds; a recorder keeps even that.
    """
    return _read_file(Path(path), isolated, sound)[0]


def read_with_state(path: str | Path) -> tuple[Recording, bool]:
    """The recording at ``path``, and whether its recorder never came to its end; raises as ``read_recording`` does."""
    return _read_file(Path(path), isolated=True, sound=True)


def _read_file(path: Path, isolated: bool, sound: bool) -> tuple[Recording, bool]:
    with _opened(path, isolated) as file:
        try:
            unfinished = isinstance(file.get("frames"), h5py.Group) and UNFINISHED in file["frames"].attrs
            return _read(Fields(path, file), sound), unfinished
        except RecordingError:
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
            raise RecordingError(f"{path}: found damaged data ({first_line(error)}), expected a whole file") from None


def read_segmentation(path: str | Path) -> NDArray[np.uint8]:
    """(T,H,W) images of what really lay in a tank, where a recording holds ``truth/segmentation``.

    Row 0 is the top (largest y). Raises ``RecordingError`` where the file has none.
    """
    path = Path(path)
    with _opened(path) as file:
        truth = Fields(path, file).subgroup("truth")
        if truth is None:
            raise RecordingError(f"{path}: /truth: found nothing, expected a group with a segmentation")
        return cast(NDArray[np.uint8], truth.numbers("segmentation", (None, None, None), np.uint8))


def _opened(path: Path, isolated: bool = True) -> h5py.File:
    """A clean copy, in memory, of the file at ``path``."""
    if path.is_dir():
        raise RecordingError(f"{path}: found a folder, expected a recording file")
    part = path.with_name(path.name + ".part")
    if not path.exists():
        hint = f" (a half-done recording is at {part}: record again to go on)" if part.exists() else ""
        raise RecordingError(f"{path}: found no such file, expected a recording{hint}")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path}: found an empty file (0 bytes), expected a recording")
    try:
        return h5py.File.in_memory(isolated_copy(path) if isolated else clean_copy(str(path)))
    except CannotRead as error:
        raise RecordingError(f"{path}: found damaged data ({error}), expected a whole file") from None
    except CannotOpen as error:
        raise _not_opened(path, str(error)) from None


def _not_opened(path: Path, reason: str) -> RecordingError:
    """Why HDF5 did not open the file, in its own words ``reason``."""
    with path.open("rb") as raw:
        head = raw.read(8)
    if head != b"\x89HDF\r\n\x1a\n":
        return RecordingError(f"{path}: found no HDF5 signature, expected an HDF5 file")
    if _being_written(path, reason):
        return RecordingError(f"{path}: found another program writing it, expected a file it has closed")
    if "already open for write" in reason:
        return RecordingError(f"{path}: found a file its writer never closed, expected a whole one")
    return RecordingError(f"{path}: found a damaged HDF5 file ({reason}), expected a whole one")


def _being_written(path: Path, reason: str) -> bool:
    """Whether a program has the file open for writing: such programs hold a lock, which HDF5 asks for first."""
    if "unable to lock file" not in reason:
        try:
            h5py.File(path, "r", locking=True).close()
        except (OSError, RuntimeError, ValueError) as error:
            reason = first_line(error)
    return "unable to lock file" in reason


def _read(root: Fields, sound: bool) -> Recording:
    found = root.text("format", "nothing")
    if found != FORMAT:
        raise root.refuse("format", repr(found), repr(FORMAT))
    version = root.number("format_version", optional=True)
    if version != FORMAT_VERSION:
        raise root.refuse("format_version", "nothing" if version is None else f"{version:g}", str(FORMAT_VERSION))
    sensor_group = root.subgroup("sensor")
    sensor = None if sensor_group is None else _read_sensor(sensor_group)
    protocol_group, frames_group = root.subgroup("protocol"), root.subgroup("frames")
    protocol = None if protocol_group is None else _read_protocol(protocol_group, sensor)
    recording = Recording(
        rig=root.text("rig", ""),
        created=root.text("created", ""),
        comment=root.text("comment", ""),
        sensor=sensor,
        protocol=protocol,
        frames=None if frames_group is None else _read_frames(frames_group, protocol),
        specimen=_read_specimen(root.subgroup("specimen")),
        rigid_block=_read_rigid_block(root.subgroup("rigid_block")),
        coupon=_read_coupon(root.subgroup("coupon")),
    )
    _refuse_empty(root, recording)
    held = frozenset(sensor_group.group.attrs) if sensor_group is not None else frozenset()
    for doubt in chain(doubts(recording, held), faults(recording) if sound else ()):
        raise RecordingError(f"{root.path}: {doubt}")
    return recording


def _refuse_empty(root: Fields, recording: Recording) -> None:
    parts = (recording.frames, recording.specimen, recording.rigid_block, recording.coupon)
    if all(part is None for part in parts):
        raise root.refuse("", "no measurement", "at least one of frames, specimen, rigid_block, coupon")


# ---------------------------------------------------------------------------------------------------------- sensor


def _read_sensor(fields: Fields) -> Sensor:
    values: dict[str, object] = {"outline_m": _read_outline(fields)}
    for name in ("sheet_resistance_ohm_sq", "contact_resistance_guess_ohm", "indenter_diameter_m"):
        value = fields.number(name, optional=True)
        if value is not None:
            if value <= 0:
                raise fields.refuse(name, f"{value:g}", "a positive number")
            values[name] = value
    values["pad_margin_m"] = fields.number("pad_margin_m", 0.0)
    values |= _read_electrodes(fields)
    if "taxel_m" in fields:
        values["taxel_m"] = fields.numbers("taxel_m", ("n", 2))
    if "layers" in fields:
        layers = _read_layers(fields)
        interface = fields.whole("piezo_interface", 0)
        if not 0 <= interface < len(layers):
            raise fields.refuse("piezo_interface", str(interface), f"0 to {len(layers) - 1}, one of the layers")
        values |= {"layers": layers, "piezo_interface": interface}
    if "indenter_points_m" in fields:
        values["indenter_points_m"] = fields.numbers("indenter_points_m", ("n", 2))
    elif "indenter_diameter_m" in values:
        values["indenter_points_m"] = four_points_m(cast(float, values["indenter_diameter_m"]))
    return Sensor(**values)  # type: ignore[arg-type]


def _read_outline(fields: Fields) -> Array:
    if "size_m" in fields.group.attrs:
        size = fields.attribute("size_m", 2)
        if (size <= 0).any():
            raise fields.refuse("size_m", str(size.tolist()), "two positive lengths")
        return rectangle_m(size)
    if "outline_m" not in fields.group:
        raise fields.refuse("size_m", "nothing", "size_m (attribute) or outline_m (dataset)")
    outline = cast(Array, fields.numbers("outline_m", ("N", 2)))
    if len(outline) < 3:
        raise fields.refuse("outline_m", f"{len(outline)} points", "at least 3")
    x, y = outline.T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) <= 0:
        raise fields.refuse("outline_m", "a clockwise or flat polygon", "a counter-clockwise one")
    return outline


def _read_electrodes(fields: Fields) -> dict[str, object]:
    if "electrode_edge_m" in fields.group:
        edge = fields.numbers("electrode_edge_m", ("L", 2, 2))
        if len(edge) < 2:
            raise fields.refuse("electrode_edge_m", f"{len(edge)} electrodes", "at least 2")
        return {"electrode_edge_m": edge}
    if "electrode_center_m" not in fields.group:
        raise fields.refuse("electrode_center_m", "nothing", "electrode_center_m or electrode_edge_m")
    center = cast(Array, fields.numbers("electrode_center_m", ("L", 2)))
    size = cast(Array, fields.numbers("electrode_size_m", (len(center), 2)))
    if len(center) < 2:
        raise fields.refuse("electrode_center_m", f"{len(center)} electrodes", "at least 2")
    if (size <= 0).any():
        raise fields.refuse("electrode_size_m", f"{size.min():g}", "positive lengths")
    return {"electrode_center_m": center, "electrode_size_m": size}


def _read_layers(fields: Fields) -> tuple[Layer, ...]:
    item = fields.dataset("layers")
    names = item.dtype.names
    if names is None or not set(LAYER_DTYPE.names or ()) <= set(names) or len(item.shape) != 1:
        raise fields.refuse("layers", f"{item.dtype} of shape {item.shape}", f"rows of {list(LAYER_DTYPE.names or ())}")
    if item.shape[0] > MOST_LAYERS:
        raise fields.refuse("layers", f"{item.shape[0]} layers", f"{MOST_LAYERS} at most")
    layers: list[Layer] = []
    for row in item[()]:
        raw = row["name"]
        name = raw.decode("utf-8", "replace") if isinstance(raw, bytes) else str(raw)
        layer = Layer(name, float(row["thickness_m"]), float(row["youngs_modulus_pa"]), float(row["poissons_ratio"]))
        if not (layer.thickness_m > 0 and layer.youngs_modulus_pa > 0 and -1 < layer.poissons_ratio < 0.5):
            expected = "thickness and modulus above 0, Poisson's ratio between -1 and 0.5"
            raise fields.refuse(f"layers[{len(layers)}]", str(layer), expected)
        layers.append(layer)
    if not layers:
        raise fields.refuse("layers", "none", "at least one layer")
    return tuple(layers)


# -------------------------------------------------------------------------------------------------------- protocol


def _read_protocol(fields: Fields, sensor: Sensor | None) -> Protocol:
    injection = _read_injection(fields)
    pairs, current = injection
    electrodes = _electrode_count(fields, pairs, current, sensor)
    _refuse_oversized(fields, electrodes)
    if current is None:
        assert pairs is not None
        amplitude = fields.number("current_a")
        if not amplitude:
            raise fields.refuse("current_a", "0", "a current other than 0")
        current = np.zeros((len(pairs), electrodes))
        current[np.arange(len(pairs)), pairs[:, 0]] = amplitude
        current[np.arange(len(pairs)), pairs[:, 1]] = -amplitude
    weights = _read_measurement(fields, pairs, len(current), electrodes)
    extra: dict[str, object] = {"measured": _read_measured(fields, weights.shape[:2])}
    if "injection_offset_s" in fields.group:
        extra["injection_offset_s"] = fields.numbers("injection_offset_s", (len(current),))
    for name in ("scan_s", "adc_volts_per_count", "adc_limit_v"):
        value = fields.number(name, optional=True)
        if value is not None and value <= 0:
            raise fields.refuse(name, f"{value:g}", "a positive number")
        extra[name] = value
    return Protocol(current, weights, pairs, **extra)  # type: ignore[arg-type]


def _refuse_oversized(fields: Fields, electrodes: int) -> None:
    """A scan too large to work with is refused before its matrices are made."""
    injections = fields.dataset("injection" if "injection" in fields.group else "injection_current_a").shape[0]
    readings = fields.dataset("measurement").shape[-2] if "measurement" in fields.group else electrodes
    if doubt := oversized(electrodes, injections, readings):
        raise RecordingError(f"{fields.path}: {doubt}")


def _read_injection(fields: Fields) -> tuple[NDArray[np.intp] | None, Array | None]:
    if "injection" in fields.group:
        pairs = cast(NDArray[np.intp], fields.numbers("injection", ("K", 2), np.intp))
        if len(pairs) == 0 or (pairs < 0).any() or (pairs[:, 0] == pairs[:, 1]).any():
            raise fields.refuse("injection", "no, negative or equal electrodes", "pairs of different electrodes from 0")
        return pairs, None
    if "injection_current_a" not in fields.group:
        raise fields.refuse("injection", "nothing", "injection or injection_current_a")
    current = cast(Array, fields.numbers("injection_current_a", ("K", "L")))
    largest = np.max(np.abs(current), initial=0.0)
    if largest == 0.0 or np.max(np.abs(current.sum(axis=1))) > 1e-3 * largest:
        raise fields.refuse("injection_current_a", "rows that don't sum to zero", "what goes in comes out")
    return None, current


def _electrode_count(
    fields: Fields, pairs: NDArray[np.intp] | None, current: Array | None, sensor: Sensor | None
) -> int:
    if sensor is not None:
        electrodes = sensor.electrodes
    elif current is not None:
        electrodes = current.shape[1]
    else:
        assert pairs is not None
        electrodes = int(pairs.max()) + 1
    if current is not None and current.shape[1] != electrodes:
        raise fields.refuse("injection_current_a", f"{current.shape[1]} columns", f"{electrodes}, one per electrode")
    if pairs is not None and pairs.max() >= electrodes:
        raise fields.refuse("injection", f"electrode {pairs.max()}", f"0 to {electrodes - 1}")
    return electrodes


def _read_measurement(fields: Fields, pairs: NDArray[np.intp] | None, injections: int, electrodes: int) -> Array:
    """(K,M,L) weights of the electrodes' potentials in each reading."""
    if "measurement" in fields.group:
        by_injection = len(fields.dataset("measurement").shape) == 3
        shape = (injections, "M", 2) if by_injection else ("M", 2)
        columns = cast(NDArray[np.intp], fields.numbers("measurement", shape, np.intp))
        if columns.size == 0 or columns.min() < 0 or columns.max() >= electrodes:
            found = f"electrodes {columns.min()} to {columns.max()}" if columns.size else "no pair"
            raise fields.refuse("measurement", found, f"pairs of electrodes 0 to {electrodes - 1}")
        weights = np.eye(electrodes)[columns[..., 0]] - np.eye(electrodes)[columns[..., 1]]
        return np.broadcast_to(weights, (injections, *weights.shape[-2:])).copy()
    reference = fields.text("reference", "nothing")
    if reference != "sink" or pairs is None:
        raise fields.refuse("reference", repr(reference), "'sink' with injection, or a dataset measurement")
    weights = np.broadcast_to(np.eye(electrodes), (injections, electrodes, electrodes)).copy()
    weights[np.arange(injections), :, pairs[:, 1]] -= 1.0
    return weights


def _read_measured(fields: Fields, shape: tuple[int, ...]) -> NDArray[np.bool_] | None:
    if "measured" not in fields.group:
        return None
    measured = fields.numbers("measured", shape, np.uint8)
    if measured.max(initial=0) > 1 or not measured.any():
        raise fields.refuse(
            "measured", f"values up to {measured.max(initial=0)}", "true for readings taken, some of them"
        )
    return measured.astype(bool)


# ---------------------------------------------------------------------------------------------------------- frames


def _read_frames(fields: Fields, protocol: Protocol | None) -> Frames:
    frames = _whole_frames(fields)
    shape = (None, *(protocol.shape if protocol is not None else (None, None)))
    voltage = cast(NDArray[np.float32], fields.numbers("voltage_v", shape, np.float32, finite=False, rows=frames))
    _refuse_odd_voltages(fields, voltage, protocol)
    count = None
    if "adc_count" in fields.group:
        shape = (None, *voltage.shape[1:])
        count = cast(NDArray[np.int32], fields.numbers("adc_count", shape, np.int32, rows=frames))
    return Frames(voltage, _read_history(fields, frames), count)


def _refuse_odd_voltages(fields: Fields, voltage_v: NDArray[np.float32], protocol: Protocol | None) -> None:
    """NaN is a reading not taken, or lost; nothing else may stand for one."""
    if np.isinf(voltage_v).any():
        raise fields.refuse("voltage_v", f"{int(np.isinf(voltage_v).sum())} infinite values", "volt, or NaN where lost")
    if voltage_v.size and np.isnan(voltage_v).all():
        raise fields.refuse("voltage_v", "NaN alone", "volt in some reading")
    if protocol is not None and not np.isnan(voltage_v[:, ~protocol.taken]).all():
        raise fields.refuse("voltage_v", "numbers where /protocol/measured is false", "NaN in readings not taken")


def _whole_frames(fields: Fields) -> int:
    """Number of frames; a file that is still growing may have some columns a frame ahead of the others."""
    names = ["voltage_v", "time_s", "press", "phase"]
    names += [n for n in ("contact_m", "depth_m", "force_n", "adc_count") if n in fields.group]
    lengths = {}
    for name in names:
        item = fields.dataset(name)
        if not item.shape:
            raise fields.refuse(name, "a scalar", "one entry per frame")
        lengths[name] = item.shape[0]
    least = min(lengths.values())
    for name, length in lengths.items():
        if length != lengths["time_s"] and UNFINISHED not in fields:
            raise fields.refuse(name, f"{length} frames", f"{lengths['time_s']} as in time_s")
    return least


def _read_history(fields: Fields, frames: int) -> History:
    phase = cast(NDArray[np.uint8], fields.numbers("phase", (None,), np.uint8, rows=frames))
    if phase.max(initial=0) > 3:
        raise fields.refuse("phase", str(phase.max()), "0 rest, 1 loading, 2 hold, 3 unloading")
    contact = depth = force = None
    if "contact_m" in fields.group:
        contact = fields.numbers("contact_m", (None, "P", 2), finite=False, rows=frames)
        if np.isinf(contact).any() or (np.isnan(contact[..., 0]) != np.isnan(contact[..., 1])).any():
            raise fields.refuse("contact_m", "infinite or half-known positions", "both coordinates or NaN for none")
    if "depth_m" in fields.group:
        depth = fields.numbers("depth_m", (None, "P"), finite=False, rows=frames)
    if "force_n" in fields.group:
        force = fields.numbers("force_n", (None, "P"), finite=False, rows=frames)
    contacts = {
        name: a.shape[1]
        for name, a in (("contact_m", contact), ("depth_m", depth), ("force_n", force))
        if a is not None
    }
    width = next(iter(contacts.values()), 0)
    for name, found in contacts.items():
        if found != width:
            raise fields.refuse(name, f"{found} contacts a frame", f"{width} as in the other fields")
    return History(
        time_s=cast(Array, fields.numbers("time_s", (None,), rows=frames)),
        press=cast(NDArray[np.int64], fields.numbers("press", (None,), np.int64, rows=frames)),
        phase=phase,
        contact_m=np.full((frames, width, 2), np.nan) if contact is None else cast(Array, contact),
        depth_m=np.full((frames, width), np.nan) if depth is None else cast(Array, depth),
        force_n=np.full((frames, width), np.nan) if force is None else cast(Array, force),
    )


# --------------------------------------------------------------------------------------------------- other parts


def _read_specimen(fields: Fields | None) -> Specimen | None:
    if fields is None:
        return None
    stress = cast(Array, fields.numbers("stress_pa", ("N",)))
    length = len(stress)
    resistance = cast(Array, fields.numbers("sheet_resistance_ohm_sq", (length,)))
    if (resistance <= 0).any():
        raise fields.refuse("sheet_resistance_ohm_sq", f"{resistance.min():g}", "positive resistances")
    time_s = cast(Array, fields.numbers("time_s", (length,)))
    cycle = cast(NDArray[np.int64], fields.numbers("cycle", (length,), np.int64))
    return Specimen(stress, resistance, time_s, cycle)


def _read_rigid_block(fields: Fields | None) -> RigidBlock | None:
    if fields is None:
        return None
    depth = cast(Array, fields.numbers("depth_m", ("N",)))
    return RigidBlock(depth, cast(Array, fields.numbers("force_n", (len(depth),))))


def _read_coupon(fields: Fields | None) -> Coupon | None:
    if fields is None:
        return None
    time_s = cast(Array, fields.numbers("time_s", ("N",)))
    height, area = fields.number("height_m"), fields.number("area_m2")
    for name, value in (("height_m", height), ("area_m2", area)):
        if value is None or value <= 0:
            raise fields.refuse(name, f"{value}", "a positive number")
    lateral = fields.text("lateral")
    if lateral not in ("free", "confined"):
        raise fields.refuse("lateral", repr(lateral), "'free' or 'confined'")
    gap = cast(Array, fields.numbers("gap_m", (len(time_s),)))
    force = cast(Array, fields.numbers("force_n", (len(time_s),)))
    sample_s = fields.number("sample_s", optional=True)
    return Coupon(time_s, gap, force, cast(float, height), cast(float, area), lateral, sample_s)


# --------------------------------------------------------------------------------------------------------- writing


def write_recording(path: str | Path, recording: Recording, *, overwrite: bool = False) -> None:
    """Write ``recording`` to ``path``: aside first, then renamed, so that no reader ever sees half of it.

    Raises ``RecordingError`` where a file is there already (unless ``overwrite``) or where the recording holds what the
    format can't say. The same recording gives the same bytes.
    """
    path = Path(path)
    if path.exists() and not overwrite:
        raise RecordingError(f"{path}: found a file already there, expected a free name (nothing was overwritten)")
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".writing")
    os.close(handle)
    temporary = Path(name)
    try:
        with h5py.File(temporary, "w") as file:
            write_parts(file, recording, path)
            if recording.frames is not None:
                _write_frames(file.create_group("frames"), recording.frames)
        temporary.chmod(0o644)
        with temporary.open("rb+") as raw:
            os.fsync(raw.fileno())
        move_into_place(temporary, path, overwrite=overwrite)
    finally:
        temporary.unlink(missing_ok=True)


def move_into_place(source: Path, target: Path, *, overwrite: bool) -> None:
    """Rename ``source`` to ``target``; without ``overwrite`` even a file that appeared just now is left alone."""
    if overwrite:
        os.replace(source, target)
        return
    try:
        os.link(source, target)
    except FileExistsError:
        raise RecordingError(f"{target}: found a file already there, expected a free name") from None
    except OSError:
        # File systems without hard links: the check in front of this call has to do.
        os.replace(source, target)
        return
    source.unlink()


def write_parts(file: h5py.File, recording: Recording, path: Path) -> None:
    """Write everything but the frames into an open file; ``path`` is for messages."""
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["rig"] = recording.rig
    file.attrs["created"] = recording.created
    file.attrs["comment"] = recording.comment
    if recording.sensor is not None:
        _write_sensor(file.create_group("sensor"), recording.sensor)
    if recording.protocol is not None:
        _write_protocol(file.create_group("protocol"), recording.protocol, path)
    if recording.specimen is not None:
        write_specimen(file, recording.specimen)
    if recording.rigid_block is not None:
        write_rigid_block(file, recording.rigid_block)
    if recording.coupon is not None:
        _write_coupon(file.create_group("coupon"), recording.coupon)


def _write_sensor(group: h5py.Group, sensor: Sensor) -> None:
    _, high = sensor.extent_m
    if np.array_equal(sensor.outline_m, rectangle_m(high)):
        group.attrs["size_m"] = high
    else:
        group["outline_m"] = sensor.outline_m
    # A sheet or an indenter nobody described must not come back as described.
    if sensor.sheet_resistance_ohm_sq != Sensor.sheet_resistance_ohm_sq:
        group.attrs["sheet_resistance_ohm_sq"] = sensor.sheet_resistance_ohm_sq
    if len(sensor.indenter_points_m) or sensor.indenter_diameter_m != Sensor.indenter_diameter_m:
        group.attrs["indenter_diameter_m"] = sensor.indenter_diameter_m
    group.attrs["contact_resistance_guess_ohm"] = sensor.contact_resistance_guess_ohm
    group.attrs["pad_margin_m"] = sensor.pad_margin_m
    if sensor.electrode_edge_m is not None:
        group["electrode_edge_m"] = sensor.electrode_edge_m
    else:
        group["electrode_center_m"] = sensor.electrode_center_m
        group["electrode_size_m"] = sensor.electrode_size_m
    if len(sensor.taxel_m):
        group["taxel_m"] = sensor.taxel_m
    if sensor.layers:
        group.attrs["piezo_interface"] = sensor.piezo_interface
        rows = [(x.name.encode(), x.thickness_m, x.youngs_modulus_pa, x.poissons_ratio) for x in sensor.layers]
        group["layers"] = np.array(rows, dtype=LAYER_DTYPE)
    if len(sensor.indenter_points_m):
        group["indenter_points_m"] = sensor.indenter_points_m


def _write_protocol(group: h5py.Group, protocol: Protocol, path: Path) -> None:
    if protocol.pairs is not None:
        group["injection"] = protocol.pairs.astype(np.int16)
        group.attrs["current_a"] = protocol.injection_current_a[0, protocol.pairs[0, 0]]
    else:
        group["injection_current_a"] = protocol.injection_current_a
    _write_measurement(group, protocol, path)
    if protocol.measured is not None:
        group["measured"] = protocol.measured
    if protocol.injection_offset_s is not None:
        group["injection_offset_s"] = protocol.injection_offset_s
    for name in ("scan_s", "adc_volts_per_count", "adc_limit_v"):
        if getattr(protocol, name) is not None:
            group.attrs[name] = getattr(protocol, name)


def _write_measurement(group: h5py.Group, protocol: Protocol, path: Path) -> None:
    weights, taken = protocol.measurement, protocol.taken
    if protocol.pairs is not None:
        against_sink = Protocol.against_sink(protocol.pairs, protocol.electrodes, 1.0).measurement
        if weights.shape == against_sink.shape and np.array_equal(weights, against_sink * taken[:, :, None]):
            group.attrs["reference"] = "sink"
            return
    pairs = np.stack([weights.argmax(axis=2), weights.argmin(axis=2)], axis=2)
    every = np.eye(protocol.electrodes)
    if not np.array_equal(weights, every[pairs[..., 0]] - every[pairs[..., 1]]):
        raise RecordingError(
            f"{path}: /protocol/measurement: found readings that are neither against the sink nor differences of two "
            "electrodes, expected one of these"
        )
    # A column's pair stands in any injection that takes it.
    usual = pairs[taken.argmax(axis=0), np.arange(taken.shape[1])]
    alike = (pairs == usual)[taken].all()
    group["measurement"] = (usual if alike else pairs).astype(np.int16)


def _write_frames(group: h5py.Group, frames: Frames) -> None:
    history = frames.history
    one_frame = (1, *frames.voltage_v.shape[1:])
    chunks = one_frame if len(frames) and all(one_frame) else None
    packing = {"chunks": chunks, "compression": "gzip" if chunks else None, "shuffle": bool(chunks)}
    group.create_dataset("voltage_v", data=frames.voltage_v.astype("<f4", copy=False), **packing)
    if frames.adc_count is not None:
        group.create_dataset("adc_count", data=frames.adc_count, **packing)
    group["time_s"] = history.time_s
    group["press"] = history.press
    group["phase"] = history.phase
    if history.contact_m.shape[1]:
        group["contact_m"] = history.contact_m
        group["depth_m"] = history.depth_m
        group["force_n"] = history.force_n


def write_specimen(file: h5py.File, specimen: Specimen) -> None:
    """Write the specimen test as a group of its own."""
    group = file.create_group("specimen")
    group["stress_pa"] = specimen.stress_pa
    group["sheet_resistance_ohm_sq"] = specimen.sheet_resistance_ohm_sq
    group["time_s"] = specimen.time_s
    group["cycle"] = specimen.cycle


def write_rigid_block(file: h5py.File, block: RigidBlock) -> None:
    """Write the rigid-block run as a group of its own."""
    group = file.create_group("rigid_block")
    group["depth_m"] = block.depth_m
    group["force_n"] = block.force_n


def _write_coupon(group: h5py.Group, coupon: Coupon) -> None:
    group["time_s"] = coupon.time_s
    group["gap_m"] = coupon.gap_m
    group["force_n"] = coupon.force_n
    group.attrs["height_m"] = coupon.height_m
    group.attrs["area_m2"] = coupon.area_m2
    group.attrs["lateral"] = coupon.lateral
    if coupon.sample_s is not None:
        group.attrs["sample_s"] = coupon.sample_s
