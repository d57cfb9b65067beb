"""Record an indentation experiment on a bench, real or virtual.

Presses the plan's places while force and scans are kept frame by frame. Stopped or killed, the same command goes on
with the press that was cut off, whole, and keeps its half beside the recording; ``dry_run=true`` prints the plan and
how long it takes. ``plan=PATH`` takes the plan from a YAML file, or the press a diagnosis asks for from its
``diagnosis.json``, which is added to the recording if that is there. ``plan=next`` presses where that tells most about
the skin, one press after another, until the accuracy stated is to be expected; it goes on with a recording that is
there already.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.plan import PlanError
from ertskin.hardware.recording import Recording, RecordingError

if TYPE_CHECKING:
    from omegaconf import DictConfig
    from rich.console import Console

    from ertskin.bench.next_presses import NextPresses
    from ertskin.bench.opening import OpenBench
    from ertskin.hardware.experiment import Outcome
    from ertskin.hardware.plan import Plan
    from ertskin.hardware.recorder import Recorder
    from ertskin.physics.protocol import Protocol
    from ertskin.physics.sensor import Sensor

VIRTUAL = "virtual"
"""The rig whose presses don't belong among real ones."""
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

    from ertskin.bench.opening import described, opened
    from ertskin.bench.plan_choice import chosen_plan, diagnosis_asking
    from ertskin.errors import JobFailed, UserError
    from ertskin.interrupts import Terminated

    # Recordings side by side must not draw over one another's bars.
    console, path = Console(force_terminal=False if _sweeping() else None), Path(config.recording)
    fields = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    sensor, protocol = described(fields["sensor"])
    asks = _asks(fields["plan"])
    diagnosis = diagnosis_asking(fields["plan"])
    adds = asks is not None or diagnosis is not None
    so_far = _added_to(path, sensor, protocol, str(fields["rig"]["name"])) if adds else None
    plan = asks.next(so_far, sensor, path.name, _saying(console)) if asks and config.dry_run else None
    plan = plan if asks else chosen_plan(fields["plan"], sensor)
    if plan and diagnosis and so_far:
        plan = _after(so_far, plan, path, diagnosis)
    if config.dry_run:
        _tell_plan(console, plan, sensor)
        return
    if path.exists() and not adds:
        raise RecordingError(f"{path}: found a recording already there, expected a free name (nothing was overwritten)")
    start_s = _last_frame_s(path) + RESUME_GAP_S if _half_done(path) or so_far else 0.0
    try:
        with opened(fields["rig"], sensor, protocol, start_s, purpose=plan.name if plan else "next") as bench:
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
                if asks:
                    outcome = _record_next(bench, asks, path, so_far or header, start_s, console)
                else:
                    assert plan is not None
                    outcome = _record(bench, plan, path, so_far or header, start_s, console)
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


def _asks(plan: dict[str, Any]) -> NextPresses | None:
    if plan.get("kind") != "next":
        return None
    from ertskin.bench.next_presses import NextPresses

    return NextPresses.of(plan)


def _after(so_far: Recording, plan: Plan, path: Path, diagnosis: dict[str, Any]) -> Plan:
    """The plan's presses numbered after those of the recording that the diagnosis was made of."""
    from ertskin.bench.next_presses import first_after
    from ertskin.data.shards import file_sha256
    from ertskin.errors import UserError
    from ertskin.hardware.recorder import half_done_plan

    if _half_done(path):
        return replace(plan, first=half_done_plan(path).first)
    if diagnosis.get("recording_sha256", "") not in ("", file_sha256(path)):
        raise UserError(f"plan: the press is for another recording than {path}, or added to it already: diagnose it")
    return replace(plan, first=first_after(so_far))


def _added_to(path: Path, sensor: Sensor, protocol: Protocol, rig: str) -> Recording | None:
    """The finished recording that presses are added to by ``rig``, where there is one."""
    from ertskin.bench.next_presses import check_same_skin
    from ertskin.hardware.recording import read_recording

    if not path.exists():
        return None
    recording = read_recording(path)
    check_same_skin(recording, sensor, protocol, str(path))
    if (recording.rig == VIRTUAL) != (rig == VIRTUAL):
        raise RecordingError(f"{path}: found presses of rig {recording.rig!r}, expected none of rig {rig!r} among them")
    return recording


def _saying(console: Console) -> Callable[[str], None]:
    return lambda line: console.print(line, highlight=False, soft_wrap=True)


def _tell_plan(console: Console, plan: Plan | None, sensor: Sensor) -> None:
    from ertskin.bench.display import print_plan
    from ertskin.errors import UserError
    from ertskin.hardware.experiment import check_places

    if plan is None:
        return
    try:
        check_places(plan, sensor)
    except PlanError as error:
        raise UserError(f"plan: {error}") from None
    print_plan(console, plan)


def _record(bench: OpenBench, plan: Plan, path: Path, header: Recording, start_s: float, console: Console) -> Outcome:
    from ertskin.hardware.experiment import check_plan

    check_plan(plan, bench.rig)
    if header.frames is None and not _half_done(path):
        header = _measured_before(bench, header, console)
    return _carried_out(bench, plan, path, header, bench.rig.clock.now() - start_s, console)[1]


def _record_next(
    bench: OpenBench, asks: NextPresses, path: Path, header: Recording, start_s: float, console: Console
) -> Outcome:
    """Presses asked for one by one, each knowing those before it; every one leaves a finished recording behind.

    ``header``: the recording they are added to, or one without frames.
    """
    from ertskin.errors import UserError
    from ertskin.hardware.experiment import FAILED_PRESSES, Outcome, check_plan
    from ertskin.hardware.recorder import half_done_plan

    rig, total, surface_z_m, failures = bench.rig, Outcome(), None, 0
    zero_s = rig.clock.now() - start_s
    so_far = header
    if so_far.frames is None and not _half_done(path):
        so_far = _measured_before(bench, header, console)
        if so_far.specimen is None:
            raise UserError("plan=next predicts readings by the fabric's law: the rig needs specimen or specimen_run")
    while True:
        resumed = half_done_plan(path) if _half_done(path) else None
        plan = resumed or asks.next(so_far, rig.sensor, path.name, _saying(console))
        if plan is None:
            return total
        check_plan(plan, rig)
        # What the load cell said while the next press was chosen is old.
        rig.load_cell.discard()
        so_far, outcome, surface_z_m = _carried_out(bench, plan, path, so_far, zero_s, console, surface_z_m)
        total.add(outcome)
        failures = failures + 1 if outcome.failed else 0
        if failures == FAILED_PRESSES:
            raise InstrumentError(f"{failures} presses in a row failed, the last one: {outcome.failed[-1]}")


def _carried_out(
    bench: OpenBench,
    plan: Plan,
    path: Path,
    so_far: Recording,
    zero_s: float,
    console: Console,
    surface_z_m: float | None = None,
) -> tuple[Recording, Outcome, float]:
    """The recording with the plan's presses, what came of them, and where the surface lies.

    A half-done recording at ``path`` is gone on with; else the presses are added to ``so_far``, which may be without
    frames. ``zero_s``: the bench's clock at the recording's time 0.
    """
    from ertskin.bench.display import Display
    from ertskin.bench.hands import Person
    from ertskin.hardware.experiment import Experiment

    rig, hands = bench.rig, bench.hands or Person(console)
    recorder, first = _recorder(bench, plan, path, so_far, console)
    try:
        with Display(console, plan, recorder.frames, recorder.before) as display:
            place_weights = display.stepping_aside(hands.place_weights)
            experiment = Experiment(rig, recorder, zero_s, display.show, place_weights)
            outcome = experiment.run(plan, first, surface_z_m)
    except BaseException:
        recorder.close()
        raise
    return recorder.finish(), outcome, experiment.indenter.surface_z_m


def _recorder(bench: OpenBench, plan: Plan, path: Path, so_far: Recording, console: Console) -> tuple[Recorder, int]:
    """The recorder of ``_carried_out``, and the press to begin with."""
    from ertskin.hardware.recorder import Recorder, next_press

    if _half_done(path):
        recorder, half = Recorder.resumed(path, plan)
        first = max(plan.first, next_press(half.frames and half.frames[recorder.before :]))
        console.print(f"going on at press {first + 1} of {plan.numbers.stop}", highlight=False)
        if recorder.set_apart is not None:
            console.print(f"its half that was cut off is kept in {recorder.set_apart}", highlight=False, soft_wrap=True)
        return recorder, first
    rig = bench.rig
    counts = rig.protocol.adc_volts_per_count is not None and hasattr(rig.reader, "identity")
    if so_far.frames is None:
        return Recorder(path, so_far, plan, rig.protocol.shape, counts), plan.first
    if so_far.frames.adc_count is not None and not counts:
        raise RecordingError(f"{path}: found raw counts, expected none as this rig's reader has none")
    return Recorder.adding_to(path, so_far, plan), plan.first


def _guard(bench: OpenBench, rig: dict[str, Any]) -> AbstractContextManager[None]:
    """Somebody to raise a real stage should this process be killed; a virtual one goes with it."""
    from ertskin.hardware.guardian import guarded

    return nullcontext() if bench.truth is not None else guarded(bench.rig, rig["stage"])


def _measured_before(bench: OpenBench, header: Recording, console: Console) -> Recording:
    """The header with the rigid-block run and the specimen test, where the bench has what they need."""
    from ertskin.bench.hands import Person
    from ertskin.hardware.indenter import Indenter
    from ertskin.hardware.rigid_block import press_rigid_block
    from ertskin.hardware.specimen_run import press_specimen

    geometry, hands = bench.rig.geometry, bench.hands or Person(console)
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
        from ertskin.hardware.virtual.bench.sealing import seal

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
    from ertskin.hardware.recorder import part_of

    return part_of(path).exists()


def _last_frame_s(path: Path) -> float:
    """Of the half-done recording of ``path``, or the finished one."""
    from ertskin.hardware.recorder import part_of
    from ertskin.hardware.recording import read_recording

    frames = read_recording(part_of(path) if _half_done(path) else path).frames
    return float(frames.history.time_s[-1]) if frames is not None and len(frames) else 0.0


def _kept(path: Path) -> str:
    from ertskin.hardware.recorder import part_of

    return f"what was recorded is kept in {part_of(path)}, record again to go on"


def _created(rig: dict[str, Any]) -> str:
    """Now; a virtual bench has no calendar, so that the same seed gives the same file."""
    return "2026-01-01T00:00:00Z" if rig.get("virtual") else datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
