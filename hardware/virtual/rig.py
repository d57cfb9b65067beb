"""The virtual bench put together: emulated instruments on pseudo-terminals, and the real drivers opened on them."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ertskin.hardware.clock import Clock
from ertskin.hardware.plan import Press
from ertskin.hardware.rig import Rig, open_rig
from ertskin.hardware.virtual.clock import VirtualClock
from ertskin.hardware.virtual.ert_readers import LinkReader, eit_kit_board, spectra_board
from ertskin.hardware.virtual.grbl import GrblController
from ertskin.hardware.virtual.load_cells import Mark10Gauge, futek_cell, hx711_scale
from ertskin.hardware.virtual.marlin import MarlinController
from ertskin.hardware.virtual.serving import RealTimeClock
from ertskin.hardware.virtual.skin import Skin
from ertskin.hardware.virtual.terminal import DeviceClock, Terminal
from ertskin.hardware.virtual.world import Block, Pair, SpecimenPlace, World

MARGIN_M = 0.03
"""How far the stage reaches beyond the sheet."""
PLATE_M2 = 1e-4
"""Area of the plate on a specimen."""
SPECIMEN_N_PER_M = 8e3
PLACING_S = 5.0
"""What laying weights on, taking them off or wiring takes."""
HEIGHT_M = 0.05
"""The stage's top above the sheet."""

LOAD_CELLS: Mapping[str, Callable[[DeviceClock, Path, World], Terminal]] = {
    "hx711": hx711_scale,
    "mark10": Mark10Gauge,
    "futek": futek_cell,
}
READERS: Mapping[str, Callable[[DeviceClock, Path, World], Terminal]] = {
    "link": LinkReader,
    "spectra": spectra_board,
    "eit_kit": eit_kit_board,
}


@dataclass
class VirtualBench:
    """Emulated instruments around one world, their clock, and the description of the rig that opens them."""

    world: World
    clock: Any
    stage: Any
    load_cell: Any
    reader: Any
    fields: dict[str, Any]
    folder: Path

    def open(self, clock: Clock | None = None) -> Rig:
        """The real drivers on the emulated instruments."""
        skin = self.world.skin
        return open_rig(self.fields, skin.sensor, skin.protocol, clock or self.clock)

    def place_weights(self, press: Press | None) -> None:
        """What somebody at the bench does when asked to lay a press's weights on, or with None to take them off."""
        self.clock.sleep(PLACING_S)
        if press is None or press.weight_n is None:
            self.world.lay(self.clock.now(), None)
        else:
            self.world.lay(self.clock.now(), np.array(press.contact_m), press.weight_n)

    def wire_specimen(self, wired: bool) -> None:
        """What somebody does when asked to wire the reader to the specimen, or back to the skin."""
        self.clock.sleep(PLACING_S)
        self.world.specimen_wired = wired

    def close(self) -> None:
        """Take the instruments away."""
        for device in (self.stage, self.load_cell, self.reader):
            device.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def virtual_bench(
    skin: Skin,
    stage: str = "grbl",
    load_cell: str = "hx711",
    reader: str = "link",
    sunk_m: float = 7.3e-4,
    block_stiffness_n_per_m: float | None = None,
    pair: Pair | None = None,
    limits: Mapping[str, float] | None = None,
    force_noise_n: float = 0.0,
    seed: int = 0,
    start_s: float = 0.0,
    real_time: bool = False,
) -> VirtualBench:
    """A bench around ``skin``. Its surface lies ``sunk_m`` lower than the rig's description says, for the touch-off.

    In ``real_time`` a ``Server`` must keep the devices going; otherwise the clock jumps over every wait.
    """
    folder = Path(tempfile.mkdtemp(prefix="ertskin-bench-"))
    width, depth = (float(length) for length in skin.sensor.extent_m[1])
    travel = (width + 3 * MARGIN_M, depth + 2 * MARGIN_M, HEIGHT_M + 0.01)
    if stage == "grbl":
        low, high = [-length for length in travel], [0.0, 0.0, 0.0]
        origin = (MARGIN_M - travel[0], MARGIN_M - travel[1], -HEIGHT_M)
    else:
        low, high = [0.0, 0.0, 0.0], list(travel)
        origin = (MARGIN_M, MARGIN_M, travel[2] - HEIGHT_M)
    block_place = (width + 1.5 * MARGIN_M, depth / 2)
    block = None if block_stiffness_n_per_m is None else Block(block_place, block_stiffness_n_per_m)
    specimen_place = (width + 1.5 * MARGIN_M, 0.0)
    specimen = None if pair is None else SpecimenPlace(specimen_place, pair, PLATE_M2, SPECIMEN_N_PER_M, (0, 0))
    world = World(skin, (origin[0], origin[1], origin[2] - sunk_m), block, specimen, force_noise_n, seed)
    clock: Any = RealTimeClock() if real_time else VirtualClock(start_s)
    devices: dict[str, Terminal] = {
        "stage": GrblController(clock, folder / "stage", world, travel)
        if stage == "grbl"
        else MarlinController(clock, folder / "stage", world, travel[2]),
        "load_cell": LOAD_CELLS[load_cell](clock, folder / "load_cell", world),
        "ert_reader": READERS[reader](clock, folder / "ert_reader", world),
    }
    for device in devices.values():
        clock.attach(device)
    fields: dict[str, Any] = {
        "name": "virtual",
        "stage": {"driver": stage, "port": devices["stage"].port, "travel_low_m": low, "travel_high_m": high},
        "load_cell": {"driver": load_cell, "port": devices["load_cell"].port},
        "ert_reader": {"driver": reader, "port": devices["ert_reader"].port},
        "geometry": {
            "origin_m": origin,
            "block_m": None if block is None else (origin[0] + block_place[0], origin[1] + block_place[1], origin[2]),
            "specimen_m": None
            if specimen is None
            else (origin[0] + specimen_place[0], origin[1] + specimen_place[1], origin[2]),
        },
        "limits": dict(limits or {}),
    }
    if load_cell == "hx711":
        fields["load_cell"] |= {"layout": "counts", "newton_per_count": 1 / 20_000.0, "zero_count": 81_000.0}
    return VirtualBench(world, clock, devices["stage"], devices["load_cell"], devices["ert_reader"], fields, folder)
