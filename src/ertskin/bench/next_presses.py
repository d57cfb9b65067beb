"""Presses asked for one by one, each where it tells most, until the skin is known as well as stated."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ertskin.bench.press_choice import chosen_press, first_place_m, places_to_press_m
from ertskin.data.chosen_presses import made_presses
from ertskin.data.informative_press import Accuracy
from ertskin.errors import UserError
from ertskin.hardware.plan import Plan, PlanError, Press, ramp
from ertskin.hardware.recording import Recording
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor
from ertskin.settings import checked, limited


@dataclass(frozen=True)
class NextPresses:
    """``plan=next``: stop once one contact is expected to be found to ``accuracy_n`` newton and ``accuracy_m`` metre,
    rms over sheet and forces, or at ``most`` presses. ``ramp``: how each press is made."""

    kind: str = "next"
    accuracy_n: float = limited(0.15, above=0)
    accuracy_m: float = limited(5e-4, above=0)
    most: int = limited(36, least=1)
    ramp: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> NextPresses:
        """From a configuration's ``plan``; raises ``UserError``."""
        settings = checked(cls, dict(fields), "plan")
        try:
            ramp(**settings.ramp)
        except (PlanError, TypeError) as error:
            raise UserError(f"plan.ramp: {error}") from None
        return settings

    @property
    def wanted(self) -> Accuracy:
        """The accuracy at which to stop."""
        return Accuracy(self.accuracy_n, self.accuracy_m)

    def next(self, so_far: Recording | None, sensor: Sensor, name: str, say: Callable[[str], None]) -> Plan | None:
        """A plan of the one press to make after those of the recording; None where they are enough.

        ``say`` gets what accuracy is expected now, and why there is no press more. Raises ``UserError`` where the
        recording can't tell where to press.
        """
        places, made = places_to_press_m(sensor), presses_made(so_far)
        if so_far is None or not made:
            return self._plan(first_place_m(places, sensor), so_far)
        choice = chosen_press(so_far, name, places, self.wanted)
        said = f"{made} press{'es' if made > 1 else ''}: one contact is expected to be found to {choice.now}"
        if choice.now.within(self.wanted):
            say(f"{said}: as wanted, no press more")
            return None
        if made >= self.most:
            say(f"{said}, {self.wanted} is wanted; stopped at plan.most={self.most}")
            return None
        x, y = (1e3 * c for c in choice.place_m)
        say(f"{said}; next at ({x:.1f}, {y:.1f}) mm, then {choice.then}")
        return self._plan(choice.place_m, so_far)

    def _plan(self, place_m: tuple[float, float], so_far: Recording | None) -> Plan:
        return Plan("next", (Press((place_m,), ramp(**self.ramp)),), first=first_after(so_far))


def first_after(recording: Recording | None) -> int:
    """The number of a press after those of the recording."""
    made = None if recording is None or recording.frames is None else made_presses(recording.frames)
    # What was at rest after the last press is at rest before this one.
    return 0 if made is None or not len(made) else int(made[-1]) + 1


def presses_made(recording: Recording | None) -> int:
    """Presses in a recording, none where there is none."""
    return 0 if recording is None or recording.frames is None else len(made_presses(recording.frames))


def check_same_skin(recording: Recording, sensor: Sensor, protocol: Protocol, name: str) -> None:
    """Raise ``UserError`` where presses on ``sensor`` can't be added to ``recording``."""
    for wrong, what in _differences(recording, sensor, protocol):
        if wrong:
            raise UserError(f"{name}: {what}, so no press can be added to it: choose another recording or sensor")


def _differences(recording: Recording, sensor: Sensor, protocol: Protocol) -> Iterator[tuple[bool, str]]:
    frames, other, scan = recording.frames, recording.sensor, recording.protocol
    if frames is None or other is None or scan is None:
        yield True, "has no frames of a sensor with a protocol"
        return
    yield frames.history.contact_m.shape[1] != 1, "holds presses of several contacts"
    yield (
        scan.design.shape != protocol.design.shape or not np.allclose(scan.design, protocol.design),
        "has another scan",
    )
    places = (other.electrode_middle_m, sensor.electrode_middle_m), (other.outline_m, sensor.outline_m)
    yield any(a.shape != b.shape or not np.allclose(a, b, atol=1e-6) for a, b in places), "is of another sheet"
