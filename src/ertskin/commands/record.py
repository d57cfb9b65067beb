"""Record an indentation experiment on a bench, real or virtual.

Presses the plan's places while force and scans are kept frame by frame. Stopped or killed, the same command goes on at
the next press; ``dry_run=true`` prints the plan and how long it takes. ``plan=PATH`` takes the plan from a YAML file,
or the presses a diagnosis asks for from its ``diagnosis.json``.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from hardware.failure import InstrumentError
from hardware.plan import PlanError
from hardware.recording import Recording, RecordingError

if TYPE_CHECKING:
    from omegaconf import DictConfig
    from rich.console import Console

    from ertskin.bench.hands import Hands
    from ertskin.bench.opening import OpenBench
    from hardware.experiment import Outcome
    from hardware.plan import Plan

RESUME_GAP_S = 60.0
"""Seconds that pass, in a recording gone on with, between its last frame and the next at least."""


def reworded(arguments: list[str]) -> list[str]:
    """``plan=PATH`` as ``plan=file plan.path=PATH``: the choices of a group are names."""
    words = []
    for word in arguments:
        key, _, value = word.partition("=")
        is_path = key == "plan" and Path(value).suffix in (".yaml", ".json")
        words += ["plan=file", f"plan.path={value}"] if is_path else [word]
    return words


def run(config: DictConfig) -> None:
    """Record ``config.plan`` on ``config.rig`` into ``config.recording``."""
    from omegaconf import OmegaConf
    from rich.console import Console

    from ertskin.bench.display import print_plan
    from ertskin.bench.opening import described, opened
    from ertskin.bench.plan_choice import chosen_plan
    from ertskin.errors import JobFailed, UserError
    from ertskin.interrupts import Terminated

    # Recordings side by side must not draw over one another's bars.
    console, path = Console(force_terminal=False if _sweeping() else None), Path(config.recording)
    fields = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    sensor, protocol = described(fields["sensor"])
    plan = chosen_plan(fields["plan"], sensor)
    if config.dry_run:
        print_plan(console, plan)
        return
    if path.exists():
        raise RecordingError(f"{path}: found a recording already there, expected a free name (nothing was overwritten)")
    start_s = _last_frame_s(path) + RESUME_GAP_S if _half_done(path) else 0.0
    try:
        with opened(fields["rig"], sensor, protocol, start_s, purpose=plan.name) as bench:
            header = Recording(
                str(fields["rig"]["name"]),
                _created(fields["rig"]),
                config.comment,
                sensor,
                protocol,
                None,
                bench.specimen,
            )
            with _guard(bench, fields["rig"]):
                outcome = _record(bench, plan, path, header, start_s, console)
            _seal(bench, path, fields["rig"])
    except PlanError as error:
        raise UserError(f"plan: {error}") from None
    except InstrumentError as error:
        raise JobFailed(f"{error}; {_kept(path)}" if _half_done(path) else str(error)) from None
    except (KeyboardInterrupt, Terminated):
        if _half_done(path):
            console.print(_kept(path), highlight=False, soft_wrap=True)
        raise
    _tell(console, path, outcome)


def _record(bench: OpenBench, plan: Plan, path: Path, header: Recording, start_s: float, console: Console) -> Outcome:
    from ertskin.bench.display import Display
    from ertskin.bench.hands import Person
    from hardware.experiment import Experiment, check_plan
    from hardware.recorder import Recorder, next_press

    rig, hands = bench.rig, bench.hands or Person(console)
    check_plan(plan, rig)
    first = 0
    if _half_done(path):
        recorder, so_far = Recorder.resumed(path, plan)
        first = next_press(so_far.frames)
        console.print(f"going on at press {first + 1} of {len(plan.presses)}", highlight=False)
    else:
        header = _measured_before(bench, header, hands, console)
        counts = rig.protocol.adc_volts_per_count is not None and hasattr(rig.reader, "identity")
        recorder = Recorder(path, header, plan, rig.protocol.shape, counts)
    try:
        with Display(console, plan, recorder.frames) as display:
            place_weights = display.stepping_aside(hands.place_weights)
            experiment = Experiment(rig, recorder, rig.clock.now() - start_s, display.show, place_weights)
            outcome = experiment.run(plan, first)
    except BaseException:
        recorder.close()
        raise
    recorder.finish()
    return outcome


def _guard(bench: OpenBench, rig: dict[str, Any]) -> AbstractContextManager[None]:
    """Somebody to raise a real stage should this process be killed; a virtual one goes with it."""
    from hardware.guardian import guarded

    limits = bench.rig.limits
    if bench.truth is not None:
        return nullcontext()
    return guarded(rig["stage"], limits.clearance_m + limits.depth_m, limits.travel_speed_m_s)


def _measured_before(bench: OpenBench, header: Recording, hands: Hands, console: Console) -> Recording:
    """The header with the rigid-block run and the specimen test, where the bench has what they need."""
    from hardware.indenter import Indenter
    from hardware.rigid_block import press_rigid_block
    from hardware.specimen_run import press_specimen

    geometry = bench.rig.geometry
    pressed = geometry.specimen_m is not None and bench.setup is not None and header.specimen is None
    if geometry.block_m is None and not pressed:
        return header
    indenter = Indenter(bench.rig)
    try:
        indenter.ready()
        indenter.zero()
    except BaseException:
        indenter.retract()
        raise
    if geometry.block_m is not None:
        console.print("pressing the rigid block", highlight=False)
        header = replace(header, rigid_block=press_rigid_block(indenter))
    if pressed and bench.setup is not None:
        console.print("pressing the specimen", highlight=False)
        hands.wire_specimen(True)
        header = replace(header, specimen=press_specimen(indenter, bench.setup))
        hands.wire_specimen(False)
    return header


def _seal(bench: OpenBench, path: Path, rig: dict[str, Any]) -> None:
    """Put what is hidden in a virtual skin where nobody looks by chance."""
    if bench.truth is not None and rig.get("sealed"):
        from hardware.virtual.bench.sealing import seal

        seal(path, bench.truth, Path(rig["sealed"]), {"rig": rig["name"]})


def _tell(console: Console, path: Path, outcome: Outcome) -> None:
    console.print(
        f"{outcome.frames} frames, {outcome.presses} presses, {outcome.lost_scans} scans lost", highlight=False
    )
    for failed in outcome.failed:
        console.print(f"[yellow]given up[/yellow] {failed}", highlight=False, soft_wrap=True)
    for warning, count in outcome.warnings.items():
        console.print(f"[yellow]warning[/yellow] {warning} in {count} frames", highlight=False, soft_wrap=True)
    console.print(f"recording: {path}", highlight=False, soft_wrap=True)


def _sweeping() -> bool:
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    return HydraConfig.initialized() and HydraConfig.get().mode == RunMode.MULTIRUN


def _half_done(path: Path) -> bool:
    from hardware.recorder import part_of

    return part_of(path).exists()


def _last_frame_s(path: Path) -> float:
    from hardware.recorder import part_of
    from hardware.recording import read_recording

    frames = read_recording(part_of(path)).frames
    return float(frames.history.time_s[-1]) if frames is not None and len(frames) else 0.0


def _kept(path: Path) -> str:
    from hardware.recorder import part_of

    return f"what was recorded is kept in {part_of(path)}, record again to go on"


def _created(rig: dict[str, Any]) -> str:
    """Now; a virtual bench has no calendar, so that the same seed gives the same file."""
    return "2026-01-01T00:00:00Z" if rig.get("virtual") else datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
