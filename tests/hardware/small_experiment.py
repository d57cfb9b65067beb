"""A short experiment on the virtual bench, for tests."""

from __future__ import annotations

from pathlib import Path

from ertskin.hardware.experiment import Experiment
from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import Recorder
from ertskin.hardware.recording import Recording
from ertskin.hardware.virtual.rig import VirtualBench, virtual_bench
from ertskin.hardware.virtual.skin import SpringSkin


def bench_of(stage: str = "grbl", load_cell: str = "hx711", reader: str = "link", **options: object) -> VirtualBench:
    """A bench around a skin of springs, with some noise."""
    return virtual_bench(SpringSkin(1, noise_v=1e-3), stage, load_cell, reader, force_noise_n=0.004, **options)  # type: ignore[arg-type]


def plan_of_presses(presses: int = 2, depth_m: float = 1e-3) -> Plan:
    """The same press so many times."""
    return Plan("test", (Press(((0.03, 0.03),), ramp(depth_m, 2.5e-4, 2), rest_s=1.0),) * presses)


def recorder_of(bench: VirtualBench, plan: Plan, path: Path, counts: bool = True) -> Recorder:
    """A recorder for the bench's skin."""
    skin = bench.world.skin
    return Recorder(path, Recording("test", "", "", skin.sensor, skin.protocol), plan, skin.protocol.shape, counts)


def experiment_of(bench: VirtualBench, recorder: Recorder, **options: object) -> Experiment:
    """The experiment with the real drivers on the bench."""
    rig = bench.open()
    return Experiment(rig, recorder, rig.clock.now(), **options)  # type: ignore[arg-type]


def deepest_m(bench: VirtualBench) -> float:
    """How deep the indenter is now; negative in the air."""
    return bench.world.depth_m(bench.clock.now())
