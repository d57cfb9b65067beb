"""Which diagnosis fits a recording: a whole skin, a foam coupon alone, a tank without mechanics, or none."""

from __future__ import annotations

from collections.abc import Callable

from ertskin.diagnosis.claims import Diagnosis, HeldOut
from ertskin.diagnosis.diagnose import Selector, diagnose
from ertskin.diagnosis.findings import Findings
from ertskin.diagnosis.selection import select
from hardware.recording import Recording

Report = Callable[[float | None, str], None]


def diagnose_any(
    recording: Recording, name: str, report: Report, resolution: str = "fine", selector: Selector = select
) -> Findings:
    """Diagnose whatever the recording holds; ``selector`` chooses a skin's effects."""
    if recording.frames is None and recording.coupon is not None:
        from ertskin.diagnosis.coupon import diagnose_coupon

        return diagnose_coupon(recording.coupon, name)
    if recording.frames is not None and recording.protocol is None:
        return _refused(name, "the recording has no protocol: what a reading means is unknown")
    pressed = recording.frames is not None and bool(recording.frames.history.touched.any())
    if recording.frames is not None and recording.sensor is not None and recording.specimen is None and not pressed:
        from ertskin.diagnosis.tank import diagnose_tank

        return diagnose_tank(recording, name)
    if recording.frames is None:
        return _refused(name, "the recording holds neither frames nor a coupon")
    return diagnose(recording, name, report, resolution, selector)


def _refused(name: str, reason: str) -> Findings:
    return Findings(Diagnosis(name, "cannot_tell", HeldOut("none", None, None, None, None), reason=reason))
