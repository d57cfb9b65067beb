"""Which diagnosis fits a recording: a whole skin, a foam coupon or a specimen alone, a tank, or none."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.judge.result import Findings, refused
from ertskin.diagnosis.search.selection import Report, select
from ertskin.diagnosis.skin import Selector, diagnose
from ertskin.hardware.recording import Recording


def diagnose_any(
    recording: Recording,
    name: str,
    report: Report,
    resolution: str = "fine",
    selector: Selector = select,
    criteria: Criteria = DEFAULT,
) -> Findings:
    """Diagnose whatever the recording holds, with one BLAS thread in each thread; ``selector`` chooses the effects."""
    with threadpool_limits(1, user_api="blas"):
        return _partial(recording, name, criteria) or diagnose(recording, name, report, resolution, selector, criteria)


def _partial(recording: Recording, name: str, criteria: Criteria) -> Findings | None:
    """The findings of a recording that isn't a whole skin's, None of one that is."""
    if recording.frames is None and recording.coupon is not None:
        from ertskin.diagnosis.coupon.diagnosis import diagnose_coupon

        return diagnose_coupon(recording.coupon, name, criteria)
    if recording.frames is None and recording.specimen is not None:
        from ertskin.diagnosis.specimen.diagnosis import diagnose_specimen

        return diagnose_specimen(recording.specimen, name, criteria)
    if recording.frames is not None and recording.protocol is None:
        return refused(name, "the recording has no protocol: what a reading means is unknown")
    pressed = recording.frames is not None and bool(recording.frames.history.touched.any())
    if recording.frames is not None and recording.sensor is not None and recording.specimen is None and not pressed:
        from ertskin.diagnosis.tank.diagnosis import diagnose_tank

        return diagnose_tank(recording, name, criteria)
    if recording.frames is None:
        return refused(name, "the recording holds neither frames nor a coupon or specimen")
    return None
