"""An adjacent 16-electrode tank as other programs keep it: 208 readings a frame, in a MAT file of either kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import sparse
from scipy.io import savemat

from ertskin.hardware.description import protocol_of, sensor_of
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel

ELECTRODES, FRAMES = 16, 24
SHEET_OHM_SQ, CONTACT_OHM, NOISE_V, CURRENT_A = 480.0, 25.0, 2e-6, 1e-3
SENSOR = {
    "radius_m": 0.14,
    "sheet_resistance_ohm_sq": 500.0,
    "edge_electrodes": {"count": ELECTRODES, "width_m": 0.02},
}
SCAN = {"injection": "adjacent", "measurement": "adjacent", "measured": "undriven", "current_a": CURRENT_A}
COARSE = Resolution(2, Grading(cell_m=0.02, rim_m=2e-3, growth=2.0))


def tank_readings() -> np.ndarray:
    """(T,208) volt of the empty tank, in scan order."""
    sensor, protocol = sensor_of(SENSOR), protocol_of(SCAN, ELECTRODES)
    model = SheetModel(sensor, COARSE)
    rest = model.solve(model.uniform(SHEET_OHM_SQ), np.full(ELECTRODES, CONTACT_OHM)).pair_resistance_ohm
    readings = protocol.readings(rest)[protocol.taken]
    return readings + NOISE_V * np.random.default_rng(0).standard_normal((FRAMES, len(readings)))


def rotated(readings: np.ndarray) -> np.ndarray:
    """The same, every injection's readings begun at the driven pair as some instruments do."""
    columns = [(k + j) % ELECTRODES for k in range(ELECTRODES) for j in range(ELECTRODES)]
    protocol = protocol_of(SCAN, ELECTRODES)
    full = np.zeros((len(readings), *protocol.shape))
    full[:, protocol.taken] = readings
    injection = np.repeat(np.arange(ELECTRODES), ELECTRODES)
    taken = protocol.taken[injection, columns]
    return full[:, injection[taken], np.array(columns)[taken]]


def fwd_model(points: int = 64) -> dict[str, Any]:
    """A round EIDORS model of unit radius: a fan of triangles, electrodes of three boundary nodes, adjacent scan."""
    angle = 2 * np.pi * np.arange(points) / points
    nodes = np.vstack([np.stack([np.cos(angle), np.sin(angle)], axis=1), [[0.0, 0.0]]])
    around = np.arange(points)
    elems = np.stack([np.full(points, points), around, (around + 1) % points], axis=1) + 1
    step = points // ELECTRODES
    electrode = [
        {"nodes": np.array([(step * k + j) % points + 1 for j in (-1, 0, 1)]), "z_contact": 0.01}
        for k in range(ELECTRODES)
    ]
    stimulation = []
    for k in range(ELECTRODES):
        driven = {k, (k + 1) % ELECTRODES}
        injected = np.zeros((ELECTRODES, 1))
        injected[k], injected[(k + 1) % ELECTRODES] = CURRENT_A, -CURRENT_A
        pairs = [(m, (m + 1) % ELECTRODES) for m in range(ELECTRODES)]
        rows = np.array(
            [[(e == a) * 1.0 - (e == b) for e in range(ELECTRODES)] for a, b in pairs if not driven & {a, b}]
        )
        stimulation.append({"stim_pattern": sparse.csc_matrix(injected), "meas_pattern": sparse.csc_matrix(rows)})
    return {"nodes": nodes, "elems": elems, "electrode": electrode, "stimulation": stimulation}


def write_mat(path: Path, variables: dict[str, Any]) -> None:
    """Version 5, as ``save`` writes it by default."""
    savemat(path, {name: _matlab(value) for name, value in variables.items()})


def _matlab(value: Any) -> Any:
    """Lists of dictionaries as MATLAB's arrays of structures."""
    if isinstance(value, dict):
        return {name: _matlab(item) for name, item in value.items()}
    if isinstance(value, list):
        fields = [(name, object) for name in value[0]]
        return np.array([tuple(_matlab(item) for item in entry.values()) for entry in value], dtype=fields)
    return value


def write_mat73(path: Path, variables: dict[str, Any]) -> None:
    """Version 7.3, as ``save -v7.3`` lays it out: HDF5, transposed, arrays of structures by reference."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            _put(file, file, name, value)


def _put(file: h5py.File, group: h5py.Group, name: str, value: Any) -> None:
    if isinstance(value, dict):
        inner = group.create_group(name)
        for key, item in value.items():
            _put(file, inner, key, item)
    elif isinstance(value, list):
        inner = group.create_group(name)
        for key in value[0]:
            references = np.empty((len(value), 1), dtype=h5py.ref_dtype)
            for k, entry in enumerate(value):
                hidden = f"#refs#/{name}_{key}_{k}"
                _put(file, file, hidden, entry[key])
                references[k, 0] = file[hidden].ref
            inner.create_dataset(key, data=references, dtype=h5py.ref_dtype)
    elif sparse.issparse(value):
        inner = group.create_group(name)
        inner.attrs["MATLAB_sparse"] = np.uint64(value.shape[0])
        inner["data"], inner["ir"], inner["jc"] = value.data, value.indices, value.indptr
    else:
        group[name] = np.atleast_2d(value).T
        group[name].attrs["MATLAB_class"] = np.bytes_("double")
