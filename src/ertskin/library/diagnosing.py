"""What physics a recording shows that the simulator leaves out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.output.joint_calibration import joint_calibration
from ertskin.library.source import RecordingSource, recording_of


def diagnose(
    recording: RecordingSource,
    *,
    resolution: str = "fine",
    criteria: Criteria = DEFAULT,
    report: Callable[[float | None, str], None] = lambda share, text: None,
) -> Diagnosis:
    """Diagnose a recording, or the file at a path; seconds to minutes.

    The answer's ``verdict`` and ``claims`` say what was found, its ``effects`` go straight into ``simulate``, with the
    ``calibration`` that was fitted together with them (None where no effect was named), and ``as_builtins()`` gives the
    dictionary that ``ertskin diagnose`` writes to diagnosis.json.

    Args:
        recording: a recording in memory, or the path of one.
        resolution: "fast" or "fine": how finely the sheet is meshed. Coarse meshes look like effects.
        criteria: the numbers that are decided by, as ``Criteria(mismatch_ratio=1.1)``.
        report: called with the share done, None where it isn't known, and a line of text.

    Raises:
        UserError: where the recording can't be used at all. One that tells too little ends in "cannot_tell".
        RecordingError: where the file can't be read.
    """
    read, name = recording_of(recording)
    findings = diagnose_any(read, name, report, resolution, criteria=criteria)
    return replace(findings.diagnosis, calibration=joint_calibration(findings))
