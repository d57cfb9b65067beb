"""What a diagnosis must know of an effect to look for it: which signals show it, along what, and what that takes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Signal(StrEnum):
    """What of a recording shows an effect."""

    FORCE = "force"
    SPECIMEN = "specimen"
    COUPON = "coupon"
    REST = "rest"
    READINGS = "readings"
    NONRECIPROCAL = "nonreciprocal"
    """The part of the readings that no resistor network explains."""


class Axis(StrEnum):
    """Along what a misfit changes."""

    FORCE = "force"
    HISTORY = "history"
    TIME = "time"
    PLACE = "place"
    ELECTRODE = "electrode"
    SCAN_ORDER = "scan_order"


KIN = {
    Axis.HISTORY: "when",
    Axis.TIME: "when",
    Axis.PLACE: "where",
    Axis.ELECTRODE: "where",
    Axis.SCAN_ORDER: "how",
}
"""Axes along which one effect's wrong form can look like another effect; force alone tells no kin."""


class Need(StrEnum):
    """What a recording must contain for an effect to be identified at all."""

    FORCES = "forces with depths"
    SPECIMEN = "a specimen of the fabric"
    PRESSES = "presses"
    REST_FRAMES = "frames at rest"
    MORE_READINGS = "more readings than a resistor network has numbers"
    TIMED_INJECTIONS = "the moments of the injections"
    RELOADING = "a place that is pressed again"
    """To be distinguished from another effect that needs it too."""


class Measured(StrEnum):
    """What is measured directly instead of searched for."""

    CONTACT_PATH = "contact resistance of one electrode over time"
    PAD_SHIFT = "place of one pad"
    CHANNEL_ERROR = "gain and offset of one channel"
    READING_LIMIT = "largest reading"
    LANDING = "where the indenter lands"


@dataclass(frozen=True)
class Hypothesis:
    """An effect as a hypothesis about a recording.

    ``axes`` along which its misfit changes; ``signals`` that show it; ``needs`` of a recording; ``held`` parameters
    that the forces of a skin's recording don't tell; ``also_in_readings`` parameters of an effect of the force that
    the readings tell; ``field``: a smooth field, its ``nodes``, may stand in its place; ``must_show_at_rest``: no
    name unless the frames at rest show it too; ``measured``: what of it is measured directly, where anything is.
    """

    axes: tuple[Axis, ...]
    signals: tuple[Signal, ...]
    needs: tuple[Need, ...]
    held: frozenset[str] = frozenset()
    also_in_readings: tuple[str, ...] = ()
    field: bool = False
    must_show_at_rest: bool = False
    measured: Measured | None = None

    @property
    def kin(self) -> frozenset[str]:
        """As what the effect's wrong form may look: another effect of "when", "where" or "how"."""
        return frozenset(KIN[axis] for axis in self.axes if axis in KIN)
