"""What a recording can be used for, stage by stage, and what it lacks for the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ertskin.hardware.measurement import Recording
from ertskin.physics.history import Phase

LEAST_PRESSES = 3
"""Whole presses that leave some to be held out."""


@dataclass(frozen=True)
class Use:
    """A command, or a stage of one, with what the recording lacks for it; nothing where it can be used."""

    name: str
    lacks: tuple[str, ...] = ()
    note: str = ""

    @property
    def able(self) -> bool:
        """Whether the recording can be used for it."""
        return not self.lacks

    @property
    def because(self) -> str:
        """Why not, or what to know about it."""
        return ", ".join(self.lacks) if self.lacks else self.note


@dataclass(frozen=True)
class Parts:
    """Which parts a recording has: None for each it has, else the words that say what is missing."""

    recording: Recording

    @property
    def sensor(self) -> str | None:
        """The sensor."""
        return None if self.recording.sensor is not None else "no /sensor"

    @property
    def layers(self) -> str | None:
        """The sensor's layers."""
        sensor = self.recording.sensor
        return None if sensor is not None and sensor.layers else "no layers in /sensor"

    @property
    def protocol(self) -> str | None:
        """The protocol."""
        return None if self.recording.protocol is not None else "no /protocol"

    @property
    def frames(self) -> str | None:
        """Frames."""
        frames = self.recording.frames
        return None if frames is not None and len(frames) else "no frames"

    @property
    def rest(self) -> str | None:
        """Frames at rest."""
        frames = self.recording.frames
        found = frames is not None and bool((frames.history.phase == Phase.REST).any())
        return None if found else "no rest frames"

    @property
    def specimen(self) -> str | None:
        """The specimen's test."""
        return None if self.recording.specimen is not None else "no /specimen"

    @property
    def places(self) -> str | None:
        """Presses at known places."""
        frames = self.recording.frames
        found = frames is not None and bool(frames.history.touched.any())
        return None if found else "no frame presses at a known place"

    def forces(self, contacts: int | None = None) -> str | None:
        """Frames with known forces, with so many contacts where a number is given."""
        frames = self.recording.frames
        if frames is not None:
            known = frames.history.touched & np.isfinite(frames.history.force_n)
            count = known.sum(axis=1)
            if (count == contacts).any() if contacts else count.any():
                return None
        touching = {None: "", 1: " of one contact", 2: " of two contacts"}[contacts]
        return f"no known force{touching} at a known place"

    @property
    def depths(self) -> str | None:
        """Forces with their depths, enough to fit a stiffness."""
        frames = self.recording.frames
        if frames is not None:
            history = frames.history
            both = history.touched & np.isfinite(history.force_n) & np.isfinite(history.depth_m)
            if both.sum() >= LEAST_PRESSES:
                return None
        return "no force with a known depth"

    @property
    def presses(self) -> str | None:
        """Presses, enough to hold some out."""
        frames = self.recording.frames
        count = 0
        if frames is not None:
            count = len(np.unique(frames.history.press[frames.history.touched.any(axis=1)]))
        return None if count >= LEAST_PRESSES else f"{count} presses, {LEAST_PRESSES} at least to hold some out"


def uses_of(recording: Recording) -> list[Use]:
    """Every use of a recording, in the order of the work."""
    has = Parts(recording)
    skin = (has.sensor, has.layers, has.protocol, has.frames, has.rest, has.specimen)
    uses = [
        _use("calibrate: contact resistances", has.sensor, has.protocol, has.frames, has.rest),
        _use("calibrate: moduli of the layers", has.layers, has.depths),
        _use("calibrate: piezoresistive law", has.specimen),
        _use("calibrate: support of the indenter", None if recording.rigid_block is not None else "no /rigid_block"),
    ]
    grid = "with grid=6x6 or another: no taxels of its own"
    taxels = recording.sensor is not None and len(recording.sensor.taxel_m) > 0
    scans = (has.sensor, has.protocol, has.frames, has.rest)
    uses += [
        _use("synthesize, train", *skin, note="" if taxels else grid),
        _use("evaluate: one contact", *scans, has.forces(1)),
        _use("evaluate: two contacts", *scans, has.forces(2)),
        _use("diagnose: specimen stage", has.specimen),
        _use("diagnose: force stage", *skin, has.places, has.depths),
        _use("diagnose: readings", *skin, has.places, has.presses),
        _use("live: play", has.protocol, has.frames),
    ]
    if recording.coupon is not None:
        uses += [Use("calibrate: foam coupon"), Use("diagnose: foam coupon")]
    if not any(scans) and has.specimen and has.places:
        uses.append(Use("diagnose: tank"))
    return uses


def _use(name: str, *lacks: str | None, note: str = "") -> Use:
    return Use(name, tuple(dict.fromkeys(word for word in lacks if word is not None)), note)
