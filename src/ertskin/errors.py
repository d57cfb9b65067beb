"""What a person can put right: reported in one line, without a traceback."""

from __future__ import annotations


class UserError(Exception):
    """The request or an input file can't be used; the message says what to change. Exit status 2."""


class StepRefused(UserError):
    """A command run as a step can't be carried out, and has said why in a line of its own."""


class PastHydra(BaseException):
    """Carries its cause past Hydra, which would only warn of it, or print a line of its own about it."""


class JobFailed(Exception):
    """A job was asked for properly and went wrong, as a training that diverges; the message says how. Exit status 1."""
