"""A corpus of bad recordings: every field wrong in every common way, and what only a whole sensor can get wrong.

Each is a change to a good recording's open file, so that any recording can be spoilt. ``REFUSED`` are unusable whatever
the recording; what ``systematic`` makes may be refused or read, but never do harm. ``overwritten`` damages bytes.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

from ertskin.hardware.recording import LAYER_DTYPE

Change = Callable[[h5py.File], None]

DATASETS = (
    *(f"sensor/{name}" for name in ("electrode_center_m", "electrode_size_m", "taxel_m", "indenter_points_m")),
    *(f"protocol/{name}" for name in ("injection", "injection_offset_s")),
    *(f"frames/{name}" for name in ("voltage_v", "time_s", "press", "phase", "contact_m", "depth_m", "force_n")),
    *(f"specimen/{name}" for name in ("stress_pa", "sheet_resistance_ohm_sq", "time_s", "cycle")),
    *(f"rigid_block/{name}" for name in ("depth_m", "force_n")),
)
ATTRIBUTES = (
    *(f"sensor/{name}" for name in ("size_m", "sheet_resistance_ohm_sq", "contact_resistance_guess_ohm")),
    *(f"sensor/{name}" for name in ("indenter_diameter_m", "piezo_interface", "pad_margin_m")),
    *(f"protocol/{name}" for name in ("current_a", "scan_s", "adc_volts_per_count", "adc_limit_v")),
)
LAYER_FIELDS = ("thickness_m", "youngs_modulus_pa", "poissons_ratio")


def replaced(name: str, change: Callable[[np.ndarray], object]) -> Change:
    """Put ``change`` of a dataset in its place."""

    def apply(file: h5py.File) -> None:
        values = file[name][()]
        del file[name]
        file[name] = change(values)

    return apply


def attribute(name: str, change: Callable[[np.ndarray], object]) -> Change:
    """Put ``change`` of an attribute in its place; where there is none it begins as 1."""
    group, _, field = name.rpartition("/")

    def apply(file: h5py.File) -> None:
        file[group].attrs[field] = change(np.asarray(file[group].attrs.get(field, 1.0), dtype=float))

    return apply


def all_of(*changes: Change) -> Change:
    """Several changes, one after another."""

    def apply(file: h5py.File) -> None:
        for change in changes:
            change(file)

    return apply


def entry(name: str, place: object, value: object) -> Change:
    """Set entries of a dataset."""

    def changed(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[place] = value
        return values

    return replaced(name, changed)


def outline(points: Callable[[float, float], object]) -> Change:
    """Give the sheet an outline made of its two lengths instead of a size."""

    def apply(file: h5py.File) -> None:
        size = file["sensor"].attrs["size_m"]
        del file["sensor"].attrs["size_m"]
        file["sensor/outline_m"] = np.asarray(points(*size), dtype=float)

    return apply


def layers(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Put ``change`` of the layers in their place."""
    return replaced("sensor/layers", lambda rows: change(rows.copy()))


def _layer_value(field: str, value: float, row: int = 0) -> Change:
    def changed(rows: np.ndarray) -> np.ndarray:
        rows[field][row] = value
        return rows

    return layers(changed)


def _many_layers(rows: np.ndarray) -> np.ndarray:
    many = np.repeat(rows, -(-2000 // len(rows)))[:2000].astype(LAYER_DTYPE)
    many["name"] = [f"layer{k}".encode() for k in range(len(many))]
    many["thickness_m"] = 1e-6
    return many


def _circle(lx: float, ly: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(100_000) / 100_000
    return np.stack([0.5 * lx + lx * np.cos(angle), 0.5 * ly + ly * np.sin(angle)], axis=1)


def _swap_one(pairs: np.ndarray) -> np.ndarray:
    pairs = pairs.copy()
    pairs[1] = pairs[1, ::-1]
    return pairs


def _deleted(name: str) -> Change:
    return lambda file: file.__delitem__(name)


def _emptied(name: str) -> Change:
    def apply(file: h5py.File) -> None:
        del file[name]
        file.create_group(name)

    return apply


def _straight(values: np.ndarray) -> np.ndarray:
    return np.linspace(values.min(), values.max(), len(values))


CENTER, SIZE = "sensor/electrode_center_m", "sensor/electrode_size_m"
VOLTAGE, DEPTH, FORCE = "frames/voltage_v", "frames/depth_m", "frames/force_n"
BLOCK_DEPTH, BLOCK_FORCE = "rigid_block/depth_m", "rigid_block/force_n"

REFUSED: dict[str, Change] = {
    "electrode outside": entry(CENTER, 0, (-0.02, 0.01)),
    "all electrodes outside": replaced(CENTER, lambda c: c + 1.0),
    "electrode half outside": entry(CENTER, (0, 0), 0.0),
    "electrode at the outline": all_of(entry(CENTER, (0, 0), 2e-3), entry(SIZE, 0, 4e-3)),
    "electrodes overlapping": replaced(CENTER, lambda c: np.vstack([c[:1], c[:1] + 1e-3, c[2:]])),
    "two electrodes alike": replaced(CENTER, lambda c: np.vstack([c[:1], c[:1], c[2:]])),
    "electrodes all alike": replaced(CENTER, lambda c: np.broadcast_to(c[0], c.shape)),
    "electrodes touching": all_of(
        entry(SIZE, slice(None), 4e-3), entry(CENTER, 1, (14e-3, 10e-3)), entry(CENTER, 0, (10e-3, 10e-3))
    ),
    "tiny electrodes": replaced(SIZE, lambda s: 1e-4 * s),
    "one tiny electrode": entry(SIZE, 0, 1e-6),
    "electrode larger than the sheet": entry(SIZE, 0, 0.15),
    "electrodes larger than the sheet": replaced(SIZE, lambda s: s + 0.15),
    "bow-tie": outline(lambda x, y: [(0, 0), (x, y), (x, 0.2 * y), (0, y)]),
    "lobed bow-tie": outline(lambda x, y: [(0, 0), (x, 0), (0.2 * x, y), (x, 2 * y), (0, 2 * y), (1.2 * x, y)]),
    "outline there and back": outline(lambda x, y: [(0, 0), (x, 0), (2 * x, 0), (x, 0), (x, y), (0, y)]),
    "corner given twice": outline(lambda x, y: [(0, 0), (x, 0), (x, 0), (x, y), (0, y)]),
    "flat outline": outline(lambda x, y: [(0, 0), (x, 0), (2 * x, 0)]),
    "outline of two points": outline(lambda x, y: [(0, 0), (x, y)]),
    "outline of 100,000 points": outline(_circle),
    "sheet 1 mm thin": attribute("sensor/size_m", lambda s: np.array([s[0], 1e-3])),
    "thin with its electrodes": all_of(
        attribute("sensor/size_m", lambda s: np.array([s[0], 1e-3])),
        replaced(CENTER, lambda c: np.stack([c[:, 0], np.full(len(c), 5e-4)], axis=1)),
        replaced(SIZE, lambda s: np.full_like(s, 2e-4)),
    ),
    "sheet of kilometres": attribute("sensor/size_m", lambda s: 1e4 * s),
    "sheet of metres": attribute("sensor/size_m", lambda s: 60 * s),
    "sheet and electrodes of metres": all_of(
        attribute("sensor/size_m", lambda s: 60 * s), *(replaced(name, lambda v: 60 * v) for name in (CENTER, SIZE))
    ),
    "2,000 layers": layers(_many_layers),
    "infinite modulus": _layer_value("youngs_modulus_pa", np.inf),
    "infinite modulus below": _layer_value("youngs_modulus_pa", np.inf, -1),
    "modulus of nothing": _layer_value("youngs_modulus_pa", 1e-300),
    "infinite thickness": _layer_value("thickness_m", np.inf),
    "layer of an atom": _layer_value("thickness_m", 1e-12),
    "modulus not a number": _layer_value("youngs_modulus_pa", np.nan),
    "incompressible layer": _layer_value("poissons_ratio", 0.5),
    "two layers of one name": layers(lambda rows: np.concatenate([rows[:1], rows])),
    "margin of kilometres": attribute("sensor/pad_margin_m", lambda m: 1e3),
    "negative margin": attribute("sensor/pad_margin_m", lambda m: -0.03),
    "infinite margin": attribute("sensor/pad_margin_m", lambda m: np.inf),
    "taxels outside": replaced("sensor/taxel_m", lambda t: t + 0.5),
    "taxels all alike": replaced("sensor/taxel_m", lambda t: np.broadcast_to(t[0], t.shape)),
    "no forces": _deleted(FORCE),
    "forces unknown": replaced(FORCE, lambda f: np.full_like(f, np.nan)),
    "forces zero": replaced(FORCE, np.zeros_like),
    "forces all alike": replaced(FORCE, lambda f: np.full_like(f, 1.5)),
    "forces infinite": replaced(FORCE, lambda f: np.full_like(f, np.inf)),
    "one infinite force": entry(FORCE, 2, np.inf),
    "forces negated": replaced(FORCE, lambda f: -f),
    "depths negated": replaced(DEPTH, lambda d: -d),
    "depths infinite": replaced(DEPTH, lambda d: np.full_like(d, np.inf)),
    "time backwards": replaced("frames/time_s", lambda t: t[::-1]),
    "one time backwards": replaced("frames/time_s", lambda t: np.concatenate([t[:2], t[:1], t[3:]])),
    "time negated": replaced("frames/time_s", lambda t: -t),
    "time standing still": replaced("frames/time_s", lambda t: np.full_like(t, t[0])),
    "voltages zero": replaced(VOLTAGE, lambda v: np.zeros_like(v)),
    "voltages constant": replaced(VOLTAGE, lambda v: np.full_like(v, 1.5)),
    "voltages that never change": replaced(VOLTAGE, lambda v: np.broadcast_to(v[0], v.shape)),
    "voltages negated": replaced(VOLTAGE, lambda v: -v),
    "voltages not numbers": replaced(VOLTAGE, lambda v: np.full_like(v, np.nan)),
    "current reversed": attribute("protocol/current_a", lambda i: -i),
    "source and sink swapped": replaced("protocol/injection", lambda p: p[:, ::-1]),
    "one source and sink swapped": replaced("protocol/injection", _swap_one),
    "injections all alike": replaced("protocol/injection", lambda p: np.broadcast_to(p[0], p.shape)),
    "two injections alike": replaced("protocol/injection", lambda p: np.vstack([p[:1], p[:1], p[2:]])),
    "injections of nobody": replaced("protocol/injection", lambda p: p + 100),
    "empty specimen": _emptied("specimen"),
    "specimen without points": all_of(*(replaced(f"specimen/{n}", lambda v: v[:0]) for n in (
        "stress_pa", "sheet_resistance_ohm_sq", "time_s", "cycle"))),
    "specimen at one stress": replaced("specimen/stress_pa", lambda s: np.full_like(s, 1e4)),
    "specimen pulled": replaced("specimen/stress_pa", lambda s: -s),
    "specimen backwards": replaced("specimen/time_s", lambda t: t[::-1]),
    "empty block": _emptied("rigid_block"),
    "block without points": all_of(*(replaced(name, lambda v: v[:0]) for name in (BLOCK_DEPTH, BLOCK_FORCE))),
    "block of one point": all_of(*(replaced(name, lambda v: v[:1]) for name in (BLOCK_DEPTH, BLOCK_FORCE))),
    "flat block": replaced(BLOCK_FORCE, lambda f: np.full_like(f, 3.0)),
    "falling block": replaced(BLOCK_FORCE, lambda f: _straight(f)[::-1]),
    "block pressed at one depth": replaced(BLOCK_DEPTH, lambda d: np.full_like(d, 1e-3)),
    "empty sensor": _emptied("sensor"),
    "empty protocol": _emptied("protocol"),
    "empty frames": _emptied("frames"),
    "one electrode": all_of(*(replaced(name, lambda v: v[:1]) for name in (CENTER, SIZE))),
    "a thousand electrodes": all_of(
        *(replaced(name, lambda v: np.resize(v, (1000, 2))) for name in (CENTER, SIZE)),
    ),
}  # fmt: skip

TRANSFORMS: dict[str, Callable[[np.ndarray], object]] = {
    "negated": lambda v: -v.astype(float),
    "zeroed": np.zeros_like,
    "constant": lambda v: np.broadcast_to(v.flat[v.size // 2], v.shape),
    "reversed": lambda v: v[::-1],
    "infinite": lambda v: np.full(v.shape, np.inf),
    "empty": lambda v: v[:0],
    "first alone": lambda v: v[:1],
    "text": lambda v: np.array([b"none"] * len(v)),
}
VALUES: dict[str, Callable[[np.ndarray], object]] = {
    "negated": lambda v: -v,
    "zero": lambda v: 0.0 * v,
    "infinite": lambda v: v + np.inf,
    "huge": lambda v: v * 1e30,
    "tiny": lambda v: v * 1e-30,
}


def systematic() -> Iterator[tuple[str, Change]]:
    """Every dataset, attribute and column of the layers, wrong in every common way."""
    for name in DATASETS:
        yield f"{name} missing", _deleted(name)
        for how, change in TRANSFORMS.items():
            yield f"{name} {how}", replaced(name, change)
    for name in ATTRIBUTES:
        for how, change in VALUES.items():
            yield f"{name} {how}", attribute(name, change)
    for field in LAYER_FIELDS:
        for how, change in VALUES.items():
            yield f"layers {field} {how}", layers(_column(field, change))


def _column(field: str, change: Callable[[np.ndarray], object]) -> Callable[[np.ndarray], np.ndarray]:
    def changed(rows: np.ndarray) -> np.ndarray:
        rows[field] = change(rows[field])
        return rows

    return changed


def spoilt(good: Path, bad: Path, change: Change) -> Path:
    """A copy of ``good`` at ``bad`` with the change made."""
    shutil.copyfile(good, bad)
    with h5py.File(bad, "r+") as file:
        change(file)
    return bad


def overwritten(good: Path, bad: Path, seed: int, spans: int = 3, length: int = 24) -> Path:
    """A copy of ``good`` at ``bad`` with random bytes over a few places of its first 64 KiB, where the structure is."""
    random = np.random.default_rng(seed)
    data = bytearray(good.read_bytes())
    for start in random.integers(8, min(len(data), 65536) - length, spans):
        data[start : start + length] = random.bytes(length)
    bad.write_bytes(data)
    return bad
