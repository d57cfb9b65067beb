"""Instruments on trial: faults thrown at the drivers one after another, and every promise they make counted.

The promises: every call ends within its stated time; what is handed out is what the device measured; a scan that was
made and not handed out is reported lost; the stage is where it says it is, and after an experiment not on the skin.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ertskin.hardware.experiment import Experiment
from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import Recorder, part_of
from ertskin.hardware.recording import Recording, read_recording
from ertskin.hardware.samples import mean_force_n
from ertskin.hardware.virtual.faults import DAMAGE, Faults
from ertskin.hardware.virtual.rig import VirtualBench, virtual_bench
from ertskin.hardware.virtual.skin import SpringSkin
from ertskin.physics.protocol import Protocol

T = TypeVar("T")
READERS = ("link", "spectra", "eit_kit")
LOAD_CELLS = ("hx711", "mark10", "futek")
STAGES = ("grbl", "marlin")
LINES = {
    **dict.fromkeys(("grbl", "marlin", "mark10", "link"), ("outgoing", "incoming")),
    **dict.fromkeys(("hx711", "futek", "spectra", "eit_kit"), ("outgoing",)),
}
"""Ways a message can go; some devices are never spoken to."""
BREAKDOWNS = {
    "grbl": ("crash", "unplug", "trip"),
    "marlin": ("crash", "unplug", "keep_busy"),
    **dict.fromkeys((*READERS, *LOAD_CELLS), ("crash", "unplug")),
}
"""What can happen to a device itself."""
CONFIRMED = 0.02
"""Share of the largest reading within which two text scans confirm each other: what a damaged digit can hide in."""
FORCE_TOLERANCE_N = 0.05


@dataclass
class Tally:
    """What came of the faults thrown at one thing."""

    subject: str
    breakdowns: Counter[str] = field(default_factory=Counter)
    lines: dict[str, Faults] = field(default_factory=dict)
    handed_out: int = 0
    reported: int = 0
    wrong: int = 0
    unreported_lost: int = 0
    left_pressing: int = 0
    overdue: int = 0
    escaped: Counter[str] = field(default_factory=Counter)
    longest_s: float = 0.0

    @property
    def injected(self) -> Counter[str]:
        """Faults that took effect, by kind."""
        damaged = {f"{way} {kind}": n for way, line in self.lines.items() for kind, n in line.injected.items()}
        return self.breakdowns + Counter(damaged)

    @property
    def faults(self) -> int:
        """Faults that took effect."""
        return self.injected.total()

    def watch(self, name: str, device: Any) -> None:
        """Count what happens to a device's line."""
        self.lines[f"{name} to the host"] = device.outgoing
        self.lines[f"{name} to the device"] = device.incoming

    @property
    def broken(self) -> int:
        """Promises broken."""
        return self.wrong + self.unreported_lost + self.left_pressing + self.overdue + self.escaped.total()

    def timed(self, bench: VirtualBench, allowed_s: float, call: Callable[[], T]) -> tuple[bool, T | None]:
        """Make a call that must end within ``allowed_s`` of the bench's clock; whether it succeeded, and its value."""
        begin, real = bench.clock.now(), time.monotonic()
        try:
            return True, call()
        except InstrumentError:
            self.reported += 1
        except Exception as error:
            self.escaped[type(error).__name__] += 1
        finally:
            took = bench.clock.now() - begin
            self.longest_s = max(self.longest_s, took)
            if took > allowed_s or time.monotonic() - real > 30.0:
                self.overdue += 1
        return False, None

    def until_done(self, bench: VirtualBench, allowed_s: float, call: Callable[[], object]) -> None:
        """Make a call as often as it takes to succeed."""
        while not self.timed(bench, allowed_s, call)[0]:
            pass


def adjacent_protocol(electrodes: int) -> Protocol:
    """An EIT-kit's scan: adjacent injections, adjacent differences."""
    first = np.arange(electrodes)
    pairs = np.stack([first, (first + 1) % electrodes], axis=1)
    differences = np.eye(electrodes)[pairs[:, 0]] - np.eye(electrodes)[pairs[:, 1]]
    weights = np.broadcast_to(differences, (electrodes, electrodes, electrodes)).copy()
    return Protocol(1e-3 * differences, weights, pairs, scan_s=0.4)


def small_bench(stage: str = "grbl", load_cell: str = "hx711", reader: str = "link", seed: int = 0) -> VirtualBench:
    """A bench around a skin of springs."""
    skin = SpringSkin(seed, noise_v=1e-4)
    if reader == "eit_kit":
        skin.protocol = adjacent_protocol(skin.sensor.electrodes)
    return virtual_bench(skin, stage, load_cell, reader, seed=seed)


def try_reader(kind: str, faults: int, seed: int) -> Tally:
    """Scan under faults: on the line both ways, resets, unplugging."""
    tally, rng = Tally(f"ERT reader {kind}"), np.random.default_rng(seed)
    bench = small_bench(reader=kind, seed=seed)
    rig = bench.open()
    tally.watch(kind, bench.reader)
    made_before = lost = 0
    scan_s = rig.protocol.scan_s or 0.4
    tally.timed(bench, 10.0, rig.reader.identify)
    while tally.faults < faults:
        _throw(bench.reader, rng, tally, (*LINES[kind], *BREAKDOWNS[kind]))
        started, _ = tally.timed(bench, 20.0, rig.reader.start)
        bench.clock.sleep(scan_s)
        _, scan = tally.timed(bench, 8.0, lambda: rig.reader.finish(6.0)) if started else (False, None)
        if scan is None:
            tally.until_done(bench, 25.0, rig.reader.restore)
            continue
        tally.handed_out += 1
        lost += scan.lost
        latest = list(bench.reader.made)[-1 if kind == "link" else -8 :]
        tally.wrong += not _measured(kind, latest, scan.voltage_v, scan.count)
        if kind == "link":
            # Every scan made is handed out or reported lost; those a reset forgot can't be numbered.
            made = bench.reader.scans
            missing = made - made_before - 1 - scan.lost
            tally.unreported_lost += max(0, missing)
            made_before = made
    rig.close()
    bench.close()
    return tally


def _measured(kind: str, made: list[Any], voltage_v: Any, count: Any) -> bool:
    """Whether a scan is one of those the device made."""
    if kind == "link":
        return any(np.array_equal(count, one) for one in made)
    scale = max(float(np.abs(one).max()) for one in made)
    return any(np.abs(voltage_v - one).max() <= CONFIRMED * scale for one in made)


def try_load_cell(kind: str, faults: int, seed: int) -> Tally:
    """Weigh a constant force under faults; judged is the number a frame gets, as the experiment makes it."""
    tally, rng = Tally(f"load cell {kind}"), np.random.default_rng(seed)
    bench = small_bench(load_cell=kind, seed=seed)
    rig = bench.open()
    tally.watch(kind, bench.load_cell)
    bench.world.mover = None
    bench.world.pressed_n = 3.25
    offset = 234 / 20_000.0 if kind == "hx711" else 0.0
    tally.timed(bench, 10.0, rig.load_cell.identify)
    while tally.faults < faults:
        _throw(bench.load_cell, rng, tally, (*LINES[kind], *BREAKDOWNS[kind]))
        samples: list[Any] = []
        begin = bench.clock.now()
        while len(samples) < 4:
            _, sample = tally.timed(bench, 2.0, lambda: rig.load_cell.force(1.5))
            if sample is None:
                break
            samples.append(sample)
        if len(samples) < 4:
            tally.until_done(bench, 25.0, rig.load_cell.restore)
            continue
        tally.handed_out += 1
        force = mean_force_n(samples, begin, bench.clock.now())
        tally.wrong += abs(force - 3.25 - offset) > FORCE_TOLERANCE_N
    rig.close()
    bench.close()
    return tally


def try_stage(kind: str, faults: int, seed: int) -> Tally:
    """Go here and there under faults; wrong is a stage that says it arrived and is elsewhere."""
    tally, rng = Tally(f"stage {kind}"), np.random.default_rng(seed)
    bench = small_bench(stage=kind, seed=seed)
    rig = bench.open()
    tally.watch(kind, bench.stage)
    low, high = np.array(rig.stage.travel.low_m), np.array(rig.stage.travel.high_m)
    tally.timed(bench, 40.0, rig.stage.identify)
    tally.timed(bench, 120.0, rig.stage.home)
    while tally.faults < faults:
        _throw(bench.stage, rng, tally, (*LINES[kind], *BREAKDOWNS[kind]))
        target = low + rng.random(3) * (high - low)
        arrived, _ = tally.timed(bench, 60.0, partial(_go, bench, rig.stage, target))
        if arrived:
            tally.handed_out += 1
            tally.wrong += bool(np.abs(bench.stage.axes.at(bench.clock.now()) - target).max() > 5e-5)
            continue
        tally.until_done(bench, 200.0, partial(_recover, rig.stage))
    rig.close()
    bench.close()
    return tally


def _go(bench: VirtualBench, stage: Any, target: np.ndarray) -> None:
    seconds = stage.start_move(target, 0.05)
    bench.clock.sleep(seconds)
    deadline = bench.clock.now() + 20.0
    while stage.moving():
        if bench.clock.now() > deadline:
            raise InstrumentError("still moving")
        bench.clock.sleep(0.1)


def _recover(stage: Any) -> None:
    stage.recover()
    if not stage.trusted:
        stage.home()


def _throw(device: Any, rng: np.random.Generator, tally: Tally, kinds: tuple[str, ...]) -> None:
    """One fault of a random kind: on one of the next messages either way, or in the device."""
    kind = kinds[int(rng.integers(0, len(kinds)))]
    if kind in ("outgoing", "incoming"):
        choices = [name for name in DAMAGE if kind == "outgoing" or name != "late"]
        line = getattr(device, kind)
        line.disarm()
        line.arm(choices[int(rng.integers(0, len(choices)))], int(rng.integers(0, 3)))
        return
    if not device.plugged:
        return
    tally.breakdowns[kind] += 1
    if kind == "unplug":
        device.unplug(float(rng.uniform(0.2, 8.0)))
    elif kind == "keep_busy":
        device.keep_busy(float(rng.uniform(1.0, 15.0)))
    else:
        getattr(device, kind)()


def try_experiment(stage: str, load_cell: str, reader: str, seed: int, share: float = 0.01) -> Tally:
    """A whole experiment, a share of the messages on every line damaged and devices breaking down while it presses."""
    tally, rng = Tally(f"experiment {stage} {load_cell} {reader}"), np.random.default_rng(seed)
    bench = small_bench(stage, load_cell, reader, seed)
    rig = bench.open()
    press = Press(((0.03, 0.03),), ramp(1e-3, 2.5e-4, 2), rest_s=0.5)
    plan = Plan("trial", (press,) * 6)
    devices = {stage: bench.stage, load_cell: bench.load_cell, reader: bench.reader}

    def break_down(_progress: object) -> None:
        if rng.random() < 2 * share:
            name = list(devices)[int(rng.integers(0, 3))]
            _throw(devices[name], rng, tally, BREAKDOWNS[name])

    _wear(list(devices.values()), share, seed)
    for name, device in devices.items():
        tally.watch(name, device)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.h5"
        header = Recording("trial", "", "", rig.sensor, rig.protocol)
        recorder = Recorder(path, header, plan, rig.protocol.shape, counts=reader == "link")
        experiment = Experiment(rig, recorder, bench.clock.now(), break_down)
        tally.timed(bench, len(plan.presses) * 400.0, lambda: experiment.run(plan))
        recorder.close()
        frames = read_recording(part_of(path), sound=False).frames
    assert frames is not None
    tally.handed_out = len(frames)
    for number in range(len(frames)):
        count = None if frames.adc_count is None else frames.adc_count[number]
        tally.wrong += not _measured(reader, list(bench.reader.made), frames.voltage_v[number], count)
    tally.left_pressing += bench.world.depth_m(bench.clock.now()) > 0.0
    rig.close()
    bench.close()
    return tally


def _wear(devices: list[Any], share: float, seed: int) -> None:
    """Let every line damage a share of its messages."""
    children = iter(np.random.SeedSequence(seed).spawn(2 * len(devices)))
    for device in devices:
        device.outgoing = Faults(next(children), {kind: share / len(DAMAGE) for kind in DAMAGE})
        device.incoming = Faults(next(children), {kind: share / len(DAMAGE) for kind in DAMAGE if kind != "late"})
