"""The paper's indentation experiment (III-A): a plan carried out on a bench, frame by frame into a recorder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.failure import InstrumentError, LimitExceeded, NoAnswer
from ertskin.hardware.indenter import Indenter, StillPressing
from ertskin.hardware.instrument import Scan
from ertskin.hardware.live_checks import LiveChecks, Soundness
from ertskin.hardware.plan import Plan, PlanError, Press, Step
from ertskin.hardware.recorder import FrameEntry, Recorder
from ertskin.hardware.rig import Rig
from ertskin.hardware.samples import mean_force_n
from ertskin.physics.history import Phase
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

SCAN_SLACK_S = 4.0
SCAN_ATTEMPTS = 2
READY_ATTEMPTS = 3
FAILED_PRESSES = 3
"""Presses in a row that may fail before the bench is given up."""


@dataclass(frozen=True)
class Progress:
    """Where a recording stands: what a display shows."""

    press: int
    presses: int
    frame: int
    frames: int
    phase: Phase
    depth_m: float
    force_n: float
    soundness: Soundness


@dataclass
class Outcome:
    """What came of a plan."""

    frames: int = 0
    presses: int = 0
    failed: list[str] = field(default_factory=list)
    lost_scans: int = 0
    warnings: dict[str, int] = field(default_factory=dict)

    def add(self, other: Outcome) -> None:
        """Count what came of another plan too."""
        self.frames += other.frames
        self.presses += other.presses
        self.failed += other.failed
        self.lost_scans += other.lost_scans
        for warning, count in other.warnings.items():
            self.warnings[warning] = self.warnings.get(warning, 0) + count


def check_places(plan: Plan, sensor: Sensor) -> None:
    """Raise ``PlanError`` for the first press that lies off the sheet."""
    low, high = sensor.extent_m
    for number, press in enumerate(plan.presses):
        for x, y in press.contact_m:
            if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
                raise PlanError(f"press {number}: ({1e3 * x:.1f}, {1e3 * y:.1f}) mm lies off the sheet")


def check_plan(plan: Plan, rig: Rig) -> None:
    """Raise ``PlanError`` for the first press that goes beyond a limit of the bench, before anything moves."""
    check_places(plan, rig.sensor)
    x0, y0, z0 = rig.geometry.origin_m
    for number, press in enumerate(plan.presses):
        if press.depth_m > rig.limits.depth_m + 1e-9:
            limit = f"the limit of {1e3 * rig.limits.depth_m:g} mm"
            raise PlanError(f"press {number}: {1e3 * press.depth_m:.2f} mm deep, beyond {limit}")
        for x, y in press.contact_m:
            deepest = np.array([x0 + x, y0 + y, z0 - press.depth_m])
            highest = np.array([x0 + x, y0 + y, z0 + rig.limits.clearance_m])
            if press.weight_n is None and not (rig.stage.travel.holds(deepest) and rig.stage.travel.holds(highest)):
                raise PlanError(f"press {number}: lies outside the stage's travel")
        if press.weight_n is None and len(press.contact_m) != 1:
            raise PlanError(
                f"press {number}: the bench has one indenter; {len(press.contact_m)} contacts need weight_n"
            )


class Experiment:
    """One plan on one bench into one recording."""

    def __init__(
        self,
        rig: Rig,
        recorder: Recorder,
        time_zero_s: float,
        show: Callable[[Progress], None] = lambda _progress: None,
        place_weights: Callable[[Press | None], None] | None = None,
    ) -> None:
        """``time_zero_s``: the bench's clock at the recording's time 0. ``place_weights`` asks somebody to lay a
        press's weights on, and with None to take them off; plans with weights need it."""
        self.indenter = Indenter(rig)
        self.outcome = Outcome()
        self._rig = rig
        self._recorder = recorder
        self._zero_s = time_zero_s
        self._show = show
        self._place_weights = place_weights
        self._checks = LiveChecks(rig.protocol)
        self._next_frame_s = -np.inf
        self._period_s = 0.5

    def run(self, plan: Plan, first_press: int | None = None, surface_z_m: float | None = None) -> Outcome:
        """Carry the plan out from the press numbered ``first_press`` on; ``surface_z_m`` saves the touch-off.

        A press an instrument fails in is given up, noted, and the next one begun; after three in a row, at any limit
        exceeded and at Ctrl-C the indenter goes up and the exception goes on. Raises ``PlanError``, ``InstrumentError``
        (``StillPressing`` where the indenter could not be raised), ``RecordingError``.
        """
        check_plan(plan, self._rig)
        self._period_s = plan.period_s
        contacts, after = plan.contacts, plan.numbers.stop
        first = plan.first if first_press is None else first_press
        try:
            self._get_ready(plan, surface_z_m)
            for number in range(first, after):
                self._one(plan, number, contacts)
            if first <= after:
                self._rest(after, plan.final_rest_frames, contacts, plan)
        except BaseException:
            # Whatever it was, Ctrl-C included: nothing is left pressing.
            self.indenter.retract()
            raise
        self._recorder.sync()
        return self.outcome

    def _get_ready(self, plan: Plan, surface_z_m: float | None) -> None:
        """Instruments answering, load cell at zero, surface found; tried again where one fails that had answered."""
        for attempt in range(READY_ATTEMPTS):
            try:
                if attempt:
                    self.indenter.retract()
                    self.indenter.restore()
                self.indenter.ready()
                self.indenter.zero()
                self.indenter.surface_z_m = self._touched(plan) if surface_z_m is None else surface_z_m
                return
            except (LimitExceeded, StillPressing):
                raise
            except InstrumentError as error:
                self._note(f"getting ready, attempt {attempt + 1}: {error}")
                if attempt + 1 == READY_ATTEMPTS or not self.indenter.met:
                    raise

    # -------------------- presses

    def _one(self, plan: Plan, number: int, contacts: int) -> None:
        press = plan.press(number)
        try:
            if press.weight_n is None:
                self._indent(plan, number, press, contacts)
            else:
                self._weigh(plan, number, press, contacts)
            self.outcome.presses += 1
        except (LimitExceeded, StillPressing):
            raise
        except InstrumentError as error:
            self._give_up(number, error)
        self._recorder.sync()

    def _give_up(self, number: int, error: InstrumentError) -> None:
        self._note(f"press {number} given up: {error}")
        self.outcome.failed.append(f"press {number}: {error}")
        self.indenter.retract()
        recent = [int(text.split(":")[0].split()[1]) for text in self.outcome.failed[-FAILED_PRESSES:]]
        if len(recent) == FAILED_PRESSES and recent[-1] - recent[0] == FAILED_PRESSES - 1:
            raise error
        self.indenter.restore()

    def _indent(self, plan: Plan, number: int, press: Press, contacts: int) -> None:
        place = press.contact_m[0]
        self.indenter.above(place)
        self.indenter.listen(press.rest_s)
        self.indenter.check_zero()
        self._rest(number, press.rest_frames, contacts, plan)
        self.indenter.approach(place)
        depth = 0.0
        for step in press.steps:
            if step.depth_m is not None:
                depth = step.depth_m
                self.indenter.press(place, depth, press.speed_m_s)
            self._frames(plan, number, step, press, depth, contacts)
        self.indenter.lift()

    def _weigh(self, plan: Plan, number: int, press: Press, contacts: int) -> None:
        if self._place_weights is None:
            raise PlanError(f"press {number}: needs somebody to place weights")
        if press.rest_frames:
            self._rest(number, press.rest_frames, contacts, plan)
        self._place_weights(press)
        # However long that took: samples that waited meanwhile are old.
        self._rig.load_cell.discard()
        for step in press.steps:
            self._frames(plan, number, step, press, float("nan"), contacts)
        self._place_weights(None)

    def _rest(self, number: int, frames: int, contacts: int, plan: Plan) -> None:
        nothing = np.full(contacts, np.nan)
        for _ in range(frames):
            self._frame(plan, number, Phase.REST, np.full((contacts, 2), np.nan), nothing, None)

    def _frames(self, plan: Plan, number: int, step: Step, press: Press, depth_m: float, contacts: int) -> None:
        contact = np.full((contacts, 2), np.nan)
        contact[: len(press.contact_m)] = press.contact_m
        depth = np.full(contacts, np.nan)
        depth[: len(press.contact_m)] = depth_m
        self.indenter.listen(step.wait_s)
        for _ in range(step.frames):
            self._frame(plan, number, step.phase, contact, depth, press.weight_n)

    # -------------------- frames

    def _frame(
        self, plan: Plan, number: int, phase: Phase, contact_m: Array, depth_m: Array, weight_n: float | None
    ) -> None:
        """One frame; returns when it is kept. A scan that fails is noted and taken once more."""
        self.indenter.listen(self._next_frame_s - self._rig.clock.now())
        scan = self._scan()
        self._next_frame_s = scan.time_s + self._period_s
        scan_s = self._rig.protocol.scan_s or 0.0
        samples = list(self.indenter.samples)
        force = np.full(len(depth_m), np.nan)
        measured = mean_force_n(samples, scan.time_s, scan.time_s + scan_s)
        pressed = np.isfinite(contact_m).all(axis=1)
        if weight_n is not None:
            force[pressed] = weight_n
        else:
            force[0] = measured
        if scan.lost:
            self.outcome.lost_scans += scan.lost
            self._note(f"{scan.lost} scans lost before frame {self._recorder.frames}")
        time_s = scan.time_s - self._zero_s
        entry = FrameEntry(scan.voltage_v, scan.count, time_s, number, phase, contact_m, depth_m, force)
        self._recorder.append(entry)
        self.outcome.frames += 1
        soundness = self._checks.look(scan)
        for warning in soundness.warnings():
            kind = warning.split(" ", 2)[-1] if warning[0].isdigit() else warning.rsplit(" ", 2)[0]
            self.outcome.warnings[kind] = self.outcome.warnings.get(kind, 0) + 1
        self._show(
            Progress(
                number, plan.numbers.stop, self._recorder.frames, plan.frames, phase, float(depth_m[0]), measured,
                soundness,
            )
        )  # fmt: skip

    def _scan(self) -> Scan:
        scan_s = self._rig.protocol.scan_s or 0.5
        for attempt in range(SCAN_ATTEMPTS):
            self._rig.reader.start()
            self.indenter.listen(scan_s)
            try:
                return self._rig.reader.finish(scan_s + SCAN_SLACK_S)
            except NoAnswer as error:
                self._note(f"frame {self._recorder.frames}, attempt {attempt + 1}: {error}")
                if attempt + 1 == SCAN_ATTEMPTS:
                    raise
        raise AssertionError("unreachable")

    def _note(self, text: str) -> None:
        self._recorder.note(self._rig.clock.now() - self._zero_s, text)

    def _touched(self, plan: Plan) -> float:
        """Feel for the surface at the first place the plan presses."""
        pressed = [press for press in plan.presses if press.weight_n is None]
        if not pressed:
            return self._rig.geometry.origin_m[2]
        place = pressed[0].contact_m[0]
        self.indenter.above(place)
        self.indenter.check_zero()
        self.indenter.approach(place)
        x, y, z = self._rig.stage.position_m()
        surface = self.indenter.touch_off(float(x), float(y), float(z))
        self.indenter.lift()
        return surface
