"""A calibrated skin's response to a touch anywhere, solved once, kept, and read again."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ertskin.data.forward import PressForward
from ertskin.data.shards import ShardStore, fill, request_key
from ertskin.data.skin_forward import SkinForward
from ertskin.data.synthesis import Shard
from ertskin.files import write_whole
from ertskin.physics.skin import Skin
from ertskin.physics.touch.interplay import Interplay
from ertskin.physics.touch.table import ResponseTable, TouchGrid
from ertskin.physics.trials import Trials

Array = NDArray[np.float64]

SPLINES = ("knots_x", "knots_y", "knots_n", "response", "cell_s")
"""What of a ``ResponseTable`` takes long to make."""
CELL_SAMPLES = 3
"""Points, squared, over which a cell's conductance is averaged."""
CELL_REACH = 3.2
"""Cells further from a contact than this many of their own size stay as they were."""


@dataclass(frozen=True)
class TablePlan:
    """Places ``spacing_m`` apart, ``forces`` up to the largest, cells of ``cell_m`` for what contacts do together.

    Within 14 mm of a pad a response changes fast with the place: on `rig_a`, corrected by its presses, the sizes of
    single contacts' responses there scatter by 2.2 % about the recorded ones with places 4 mm apart, by 0.95 % with 3
    and by 0.90 % with 2.5; elsewhere by 0.5 %. Cells of 6 mm leave 15 % of an interplay that itself is 0.6 % of two
    contacts' response (2.7 % at most).
    """

    spacing_m: float = 3e-3
    forces: int = 8
    cell_m: float = 6e-3
    places_per_shard: int = 25


def touch_table(
    folder: Path,
    request: dict[str, Any],
    plan: TablePlan,
    forward: SkinForward,
    max_force_n: float,
    cluster: Any,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ResponseTable, str]:
    """The table and its checksum; what is there already is only read, a table that was cut off goes on.

    ``request``: plain data that names the skin. ``progress(done, total)`` counts shards.
    """
    grid = TouchGrid.over(forward.calibration.known_sensor.extent_m, plan.spacing_m, plan.forces, max_force_n)
    contact_m, force_n = grid.presses()
    rows = plan.places_per_shard * plan.forces
    shards = -(-len(force_n) // rows)
    asked = {**request, "table": {"spacing_m": plan.spacing_m, "force_n": grid.force_n.tolist()}}
    store = ShardStore(folder / request_key(asked), asked, shards)
    if missing := store.missing():
        presses = Trials(np.zeros(force_n.shape, dtype=np.intp), contact_m, force_n)
        progress(shards - len(missing), shards)
        done = iter(range(shards - len(missing) + 1, shards + 1))
        fill(store, Shard(forward, presses, rows), cluster.spread, lambda number: progress(next(done), shards))
    elif not store.sealed:
        store.seal()
    pressed = forward.built
    assert isinstance(pressed, PressForward)
    interplay = Interplay.of(pressed.rest, plan.cell_m)
    # Another version wherever ``cell_changes_s`` or ``ResponseTable.through`` gives other numbers.
    sampling = {"version": 1, "solved": store.checksum, "cell_m": plan.cell_m}
    sampling |= {"samples": CELL_SAMPLES, "reach": CELL_REACH}
    path = store.folder / f"splines-{request_key(sampling)}.npz"
    if (table := kept_splines(path, grid, interplay)) is None:
        cells = cell_changes_s(pressed.skin, interplay, grid, plan.cell_m)
        table = ResponseTable.through(grid, store.read()["change_ohm"], cells, interplay)
        keep_splines(path, table)
    return table, store.checksum


def kept_splines(path: Path, grid: TouchGrid, interplay: Interplay) -> ResponseTable | None:
    """The splines through the table as they were made before; None where there are none, or damaged ones."""
    try:
        with np.load(path, allow_pickle=False) as found:
            kept = {name: found[name] for name in SPLINES}
    except (OSError, EOFError, KeyError, ValueError, BadZipFile):
        return None
    read = np.eye(kept["response"].shape[3])
    return ResponseTable(grid=grid, interplay=interplay, read=read, **kept)


def keep_splines(path: Path, table: ResponseTable) -> None:
    """Write them for ``kept_splines``."""
    stream = io.BytesIO()
    np.savez(stream, **{name: getattr(table, name) for name in SPLINES})
    write_whole(path, stream.getvalue())


def cell_changes_s(skin: Skin, interplay: Interplay, grid: TouchGrid, cell_m: float) -> Array:
    """(X*Y*F,C) change of each cell's mean conductance under ``grid.presses``, a second after they began."""
    inside = ((np.arange(CELL_SAMPLES) + 0.5) / CELL_SAMPLES - 0.5) * cell_m
    sample = np.stack(np.meshgrid(inside, inside), axis=-1).reshape(-1, 2)
    position = (interplay.center_m[:, None] + sample).reshape(-1, 2)
    untouched = _conductance_s(skin, skin.piezo.sheet_resistance_ohm_sq(np.zeros(len(position))), position)
    felt_n = skin.felt_n(grid.force_n)
    place_m = grid.presses()[0][:: len(felt_n), 0]
    change = np.zeros((len(place_m), len(felt_n), len(interplay.center_m)))
    for k, place in enumerate(place_m):
        near = np.flatnonzero(((interplay.center_m - place) ** 2).sum(axis=1) < (CELL_REACH * cell_m) ** 2)
        points = (near[:, None] * len(sample) + np.arange(len(sample))).ravel()
        pressed = felt_n[:, None] * skin.pressure.at(position[points] - place)
        course = np.stack([np.zeros(pressed.size), pressed.ravel(), pressed.ravel()])
        where = np.tile(position[points], (len(felt_n), 1))
        fabric = skin.fabric_ohm_sq(course, where, np.array([0.0, 1e-3, 1.0]), np.array([2]))[0]
        added = _conductance_s(skin, fabric, where).reshape(pressed.shape) - untouched[points]
        change[k][:, near] = added.reshape(len(felt_n), len(near), -1).mean(axis=2)
    return change.reshape(-1, change.shape[2])


def _conductance_s(skin: Skin, fabric_ohm_sq: Array, position_m: Array) -> Array:
    """(N,) siemens, of an anisotropic sheet the mean of its two directions."""
    conductance = skin.sheet_conductance_s(fabric_ohm_sq, position_m)
    return conductance if conductance.ndim == 1 else 0.5 * (conductance[:, 0] + conductance[:, 2])
