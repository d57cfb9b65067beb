"""What can go wrong with an instrument. Every message names the instrument and is one line."""

from __future__ import annotations


class InstrumentError(Exception):
    """An instrument did not do what was asked."""


class LostContact(InstrumentError):
    """The port is gone: a cable pulled, a device switched off."""


class NoAnswer(InstrumentError):
    """Nothing usable came within the time allowed."""


class Refusal(InstrumentError):
    """The device itself said no: an error, an alarm, a lock."""


class LimitExceeded(InstrumentError):
    """A force, depth or travel limit would be, or was, exceeded."""
