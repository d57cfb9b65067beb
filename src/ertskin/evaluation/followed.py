"""Test frames as a network is to see them: counted from the resting skin as it is followed."""

from __future__ import annotations

from ertskin.data.touches import Followed, Touches, followed_touches
from ertskin.hardware.recording import Recording
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.calibration.following import FALSE_ALARMS


def seen_by(trained: Reconstruction, recording: Recording, zeroed: Touches, follow: bool) -> tuple[Touches, list[str]]:
    """The recording's touches, followed where asked and the network's monitor can, else ``zeroed``; and what became of
    the skin, in words."""
    if not follow or trained.monitor is None:
        return zeroed, []
    touches, course = followed_touches(recording, trained.monitor.resting)
    return touches, [in_words(course)]


def in_words(course: Followed) -> str:
    """A line for people."""
    return (
        f"resting skin followed: since its calibration the sheet has changed by {100 * course.sheet:.2g} % at most, a "
        f"contact by {100 * course.contact:.2g} %; {course.strange} of {course.frames} rest frames fit no longer "
        f"(by chance one in {round(1 / FALSE_ALARMS)})"
    )
