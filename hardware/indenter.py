"""The indenter: the stage moved under the eyes of the load cell, and off the skin again whatever happens."""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.failure import InstrumentError, LimitExceeded, NoAnswer
from ertskin.hardware.instrument import Force
from ertskin.hardware.raising import raise_patiently
from ertskin.hardware.rig import Rig
from ertskin.hardware.samples import Overload, mean_force_n

Array = NDArray[np.float64]

CELL_SILENT_S = 1.5
"""A load cell silent for so long is lost: nothing moves without it."""
MOVE_SLACK_S = 5.0
RETRACT_S = 60.0
"""How long the stage is tried to be brought off the skin."""
TOUCH_STEP_M = 2e-4


class StillPressing(InstrumentError):
    """The stage could not be brought off the skin: somebody must raise it by hand."""


class Indenter:
    """Moves in the skin's frame: x and y in the sheet's plane, depth below its surface. Newton and metres."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.samples: deque[Force] = deque(maxlen=4000)
        self.zero_n = 0.0
        self.surface_z_m = rig.geometry.origin_m[2]
        self._clock = rig.clock
        self._overload = Overload(rig.limits.force_n)
        self._heard_s = rig.clock.now()
        self.met = False
        self._lowered = False

    # -------------------- getting ready

    def ready(self) -> list[str]:
        """Have every instrument answer, the stage's frame known and the indenter in the air; who answered.

        ``met`` from then on. A stage that never answered yet is not waited for beyond its own ``identify``.
        """
        names = [self.rig.load_cell.identify(), self.rig.reader.identify()]
        try:
            names.insert(0, self.rig.stage.identify())
        except InstrumentError as error:
            if isinstance(error, NoAnswer) and not self.met:
                raise
            self.rig.stage.recover()
            names.insert(0, self.rig.stage.identify())
        self.met = True
        self._heard_s = self._clock.now()
        if not self._trusted():
            self.rig.stage.home()
        self.lift()
        return names

    def restore(self) -> None:
        """After a failure: contact with every instrument again, and the indenter in the air."""
        self.rig.load_cell.restore()
        self.rig.reader.restore()
        self.ready()

    def zero(self) -> float:
        """Take what the load cell reads in the air as zero; returns the change in newton."""
        before = self.zero_n
        self.rig.load_cell.discard()
        taken = [self._raw(CELL_SILENT_S) for _ in range(10)]
        self.zero_n = float(np.median(taken))
        self.samples.clear()
        return self.zero_n - before

    def check_zero(self) -> float:
        """The force in the air; raises ``LimitExceeded`` where it is no zero: touching, drifted or overloaded."""
        self.rig.load_cell.discard()
        force = float(np.median([self._raw(CELL_SILENT_S) for _ in range(5)])) - self.zero_n
        if abs(force) > self.rig.limits.zero_force_n:
            raise LimitExceeded(f"load cell: {force:.2f} N in the air, beyond {self.rig.limits.zero_force_n:g} N")
        return force

    # -------------------- moving

    def listen(self, seconds: float) -> None:
        """Gather samples for so long; raises ``LimitExceeded`` at an overload, ``NoAnswer`` from a silent cell."""
        end = self._clock.now() + seconds
        while (left := end - self._clock.now()) > 0:
            try:
                force = self.rig.load_cell.force(left)
            except NoAnswer:
                if self._clock.now() - self._heard_s > CELL_SILENT_S:
                    raise
                continue
            self._heard_s = force.time_s
            tared = Force(force.time_s, force.force_n - self.zero_n)
            self.samples.append(tared)
            if self._overload.seen(tared.force_n):
                raise LimitExceeded(f"force {tared.force_n:.2f} N, beyond {self.rig.limits.force_n:g} N")

    def go(self, x_m: float, y_m: float, z_m: float, speed_m_s: float) -> None:
        """Move straight to a place in the stage's frame, listening all the way."""
        high = z_m >= self.travel_z_m - 1e-6
        if not high:
            self._note_lowered(True)
        seconds = self.rig.stage.start_move(np.array([x_m, y_m, z_m]), speed_m_s)
        self.listen(seconds)
        deadline = self._clock.now() + MOVE_SLACK_S + seconds
        while self.rig.stage.moving():
            if self._clock.now() > deadline:
                raise NoAnswer(f"stage: a move of {seconds:.2g} s still runs {MOVE_SLACK_S:g} s later")
            self.listen(0.05)
        if high:
            self._note_lowered(False)

    def lift(self) -> None:
        """Straight up to the height for travelling."""
        x, y, z = self.rig.stage.position_m()
        if z < self.travel_z_m - 1e-6:
            self.go(x, y, self.travel_z_m, self.rig.limits.travel_speed_m_s)
        self._note_lowered(False)

    def above(self, contact_m: tuple[float, float]) -> None:
        """To the height for travelling above a place of the sheet."""
        self.lift()
        x, y = self._stage_xy(contact_m)
        self.go(x, y, self.travel_z_m, self.rig.limits.travel_speed_m_s)

    @contextmanager
    def pressing(self, x_m: float, y_m: float, z_m: float) -> Iterator[None]:
        """Above something that isn't the skin and whose surface lies about ``z_m``, all in the stage's frame.

        Down and up count from there, for who guards and on the way out of trouble; it goes up again whatever happens.
        """
        skin_m, speed_m_s = self.surface_z_m, self.rig.limits.travel_speed_m_s
        try:
            self.lift()
            over_skin_m, self.surface_z_m = self.travel_z_m, z_m
            high_m = max(over_skin_m, self.travel_z_m)
            self.go(x_m, y_m, max(high_m, float(self.rig.stage.position_m()[2])), speed_m_s)
            yield
            self.go(x_m, y_m, high_m, speed_m_s)
        except BaseException:
            self.retract()
            raise
        finally:
            self.surface_z_m = skin_m

    def approach(self, contact_m: tuple[float, float]) -> None:
        """Down to just above the surface, where the travelling speed ends."""
        x, y = self._stage_xy(contact_m)
        self.go(x, y, self.surface_z_m + self.rig.limits.approach_m, self.rig.limits.travel_speed_m_s)

    def press(self, contact_m: tuple[float, float], depth_m: float, speed_m_s: float) -> None:
        """To a depth below the surface; raises ``LimitExceeded`` beyond the depth limit."""
        if depth_m > self.rig.limits.depth_m + 1e-9:
            raise LimitExceeded(f"depth {1e3 * depth_m:.2f} mm, beyond {1e3 * self.rig.limits.depth_m:g} mm")
        x, y = self._stage_xy(contact_m)
        self.go(x, y, self.surface_z_m - depth_m, speed_m_s)

    def touch_off(self, x_m: float, y_m: float, start_z_m: float) -> float:
        """The height in the stage's frame at which force begins, felt for at a place in it.

        Down in steps from ``start_z_m`` until the force is above ``touch_force_n``, a few steps more, and the straight
        line through these forces taken back to zero. Raises ``LimitExceeded`` where nothing is met.
        """
        limits = self.rig.limits
        felt: list[tuple[float, float]] = []
        speed = limits.touch_speed_m_s
        z = start_z_m
        while len(felt) < 3:
            if start_z_m - z > limits.touch_range_m:
                raise LimitExceeded(f"touch-off: met nothing within {1e3 * limits.touch_range_m:g} mm")
            self.go(x_m, y_m, z, speed)
            begin = self._clock.now()
            self.listen(0.45)
            force = mean_force_n(list(self.samples), begin, self._clock.now())
            if felt or force > limits.touch_force_n:
                felt.append((z, force))
            z -= TOUCH_STEP_M if not felt or felt[-1][1] < 0.2 * limits.force_n else TOUCH_STEP_M / 10
        heights, forces = np.array(felt).T
        slope, offset = np.polyfit(heights, forces, 1)
        if slope >= 0.0:
            raise LimitExceeded("touch-off: the force does not rise with depth")
        return float(-offset / slope)

    # -------------------- getting off the skin

    def retract(self) -> None:
        """Off the skin, however things stand and whatever is pressed on the keyboard meanwhile.

        Raises ``StillPressing`` where the stage does not come back within about a minute. One that is in the air is
        stopped, and not waited for; one that never answered is left alone.
        """
        if not self._lowered and not self.met:
            return
        with _undisturbed():
            if not self._lowered:
                with suppress(InstrumentError):
                    self._stop_and_raise()
                return
            error = raise_patiently(self._stop_and_raise, self._clock, RETRACT_S)
            if error is not None:
                raise StillPressing(f"the stage may still press, raise it by hand: {error}") from error
            self._note_lowered(False)

    def _stop_and_raise(self) -> None:
        # A stage that doesn't stop when asked may yet recover.
        with suppress(InstrumentError):
            self.rig.stage.halt()
        self.rig.stage.recover()
        self._raise()

    def _raise(self) -> None:
        limits = self.rig.limits
        height = limits.clearance_m + limits.depth_m
        if not self._trusted():
            self.rig.stage.raise_by(height, limits.travel_speed_m_s)
            return
        x, y, z = self.rig.stage.position_m()
        if z >= self.travel_z_m - 1e-6:
            return
        # The load cell may be what failed: this move must not depend on it.
        seconds = self.rig.stage.start_move(np.array([x, y, self.travel_z_m]), limits.travel_speed_m_s)
        deadline = self._clock.now() + seconds + MOVE_SLACK_S
        while self.rig.stage.moving():
            if self._clock.now() > deadline:
                raise NoAnswer("stage: does not come up")
            self._clock.sleep(0.1)

    # -------------------- internals

    def _note_lowered(self, lowered: bool) -> None:
        self._lowered = lowered
        self.rig.tell_lowered(lowered)

    @property
    def travel_z_m(self) -> float:
        """The height for travelling, in the stage's frame."""
        return min(self.surface_z_m + self.rig.limits.clearance_m, self.rig.stage.travel.high_m[2])

    def _trusted(self) -> bool:
        return self.rig.stage.trusted

    def _stage_xy(self, contact_m: tuple[float, float]) -> tuple[float, float]:
        return self.rig.geometry.origin_m[0] + contact_m[0], self.rig.geometry.origin_m[1] + contact_m[1]

    def _raw(self, timeout_s: float) -> float:
        force = self.rig.load_cell.force(timeout_s)
        self._heard_s = force.time_s
        return force.force_n


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Hold back Ctrl-C, termination and the terminal's closing until the end; only the main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = {number: signal.signal(number, lambda got, _frame: held.append(got)) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            with suppress(TypeError):
                signal.signal(number, handler)
    for number in dict.fromkeys(held):
        signal.raise_signal(number)


_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK") if hasattr(signal, name)
]
