"""EIDORS structures: geometry from ``fwd_model``, the scan from its ``stimulation``.

An EIDORS model is a mesh; a recording wants the outline and where on it the electrodes are. Two dimensions and
electrodes of at least two nodes on the boundary (the complete electrode model) are needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.importing.entry import Source
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]
KEYS = {"fwd_model", "metres_per_unit", "current_scale", "file"}


def eidors_model(fields: dict[str, Any], source: Source) -> tuple[dict[str, Any], Protocol]:
    """Sensor fields and the protocol of the structure named ``fwd_model``, nodes times ``metres_per_unit``.

    Raises ``UserError`` for a model that isn't flat, or whose electrodes are points or lie inside.
    """
    if unknown := set(fields) - KEYS:
        raise source.refuse("eidors", f"unknown {', '.join(sorted(unknown))}; there are {', '.join(sorted(KEYS))}")
    path = source.path.parent / str(fields["file"]) if "file" in fields else source.path
    model: Any = source.variables(path)
    for name in str(fields.get("fwd_model", "fwd_model")).split("."):
        if not isinstance(model, dict) or name not in model:
            known = ", ".join(model) if isinstance(model, dict) else "no fields"
            raise source.refuse("eidors.fwd_model", f"{path.name} has no '{name}'; there are {known}")
        model = model[name]
    for name in ("nodes", "elems", "electrode", "stimulation"):
        if not isinstance(model, dict) or name not in model:
            raise source.refuse("eidors.fwd_model", f"has no field '{name}'")
    sensor = _geometry(model, float(fields.get("metres_per_unit", 1.0)), source)
    return sensor, _protocol(_listed(model["stimulation"]), float(fields.get("current_scale", 1.0)), source)


def _geometry(model: dict[str, Any], metres_per_unit: float, source: Source) -> dict[str, Any]:
    nodes = np.atleast_2d(np.asarray(model["nodes"], dtype=float))
    elems = np.atleast_2d(np.asarray(model["elems"], dtype=int)) - 1
    if nodes.shape[1] != 2 or elems.shape[1] != 3:
        raise source.refuse("eidors.fwd_model", f"has {nodes.shape[1]} dimensions, a sheet has 2")
    around = _outline(elems, nodes, source)
    outline = metres_per_unit * nodes[around]
    place = {int(node): k for k, node in enumerate(around)}
    edges = []
    for number, electrode in enumerate(_listed(model["electrode"])):
        own = [int(node) - 1 for node in np.ravel(electrode["nodes"])]
        if len(own) < 2 or any(node not in place for node in own):
            kind = "a point" if len(own) < 2 else "inside the sheet"
            raise source.refuse("eidors.fwd_model", f"electrode {number} is {kind}, expected nodes along the outline")
        first, last = _ends(sorted(place[node] for node in own), len(around))
        edges.append([outline[first], outline[last]])
    return {"outline_m": outline, "electrode_edge_m": np.array(edges)}


def _outline(elems: NDArray[np.intp], nodes: Array, source: Source) -> NDArray[np.intp]:
    """Nodes of the outer boundary in counter-clockwise order."""
    sides = np.concatenate([elems[:, [0, 1]], elems[:, [1, 2]], elems[:, [2, 0]]])
    unique, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    neighbours: dict[int, list[int]] = {}
    for a, b in unique[count == 1].tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    around = [next(iter(neighbours))]
    before = -1
    while True:
        onward = [node for node in neighbours[around[-1]] if node != before]
        before = around[-1]
        if not onward or onward[0] == around[0]:
            break
        around.append(onward[0])
    if len(around) != len(neighbours):
        raise source.refuse("eidors.fwd_model", "its boundary is not one closed line: holes can't be recorded")
    x, y = nodes[around].T
    area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return np.array(around if area > 0 else around[::-1])


def _ends(places: list[int], around: int) -> tuple[int, int]:
    """First and last of an electrode's places on the outline: it begins after the widest gap."""
    gaps = [(places[k] - places[k - 1]) % around for k in range(len(places))]
    first = int(np.argmax(gaps))
    return places[first], places[first - 1]


def _protocol(stimulation: list[dict[str, Any]], current_scale: float, source: Source) -> Protocol:
    current, patterns = [], []
    for step in stimulation:
        injected = np.asarray(step["stim_pattern"], dtype=float)
        if injected.ndim == 2 and 1 not in injected.shape:
            raise source.refuse("eidors.fwd_model.stimulation", "a step of several injections can't be read")
        current.append(current_scale * injected.ravel())
        patterns.append(np.asarray(step["meas_pattern"], dtype=float).reshape(-1, injected.size))
    most = max(len(pattern) for pattern in patterns)
    measured = np.array([np.arange(most) < len(pattern) for pattern in patterns])
    weights = np.array([np.pad(pattern, [(0, most - len(pattern)), (0, 0)]) for pattern in patterns])
    return Protocol(
        np.array(current), weights, _pairs(np.array(current)), measured=None if measured.all() else measured
    )


def _pairs(current_a: Array) -> NDArray[np.intp] | None:
    """(K,2) source and sink, where every injection is one pair of the same current."""
    ends = np.stack([current_a.argmax(axis=1), current_a.argmin(axis=1)], axis=1)
    size = current_a.max()
    rows = np.arange(len(ends))
    expected = np.zeros_like(current_a)
    expected[rows, ends[:, 0]], expected[rows, ends[:, 1]] = size, -size
    return ends if np.allclose(current_a, expected) else None


def _listed(value: Any) -> list[dict[str, Any]]:
    """MATLAB's array of structures; one alone is not a list."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return value
    if isinstance(value, dict):
        return [value]
    raise UserError("eidors: electrode and stimulation must be structures")
