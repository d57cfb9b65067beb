"""The simulator's numbers, fitted to a recording."""

from __future__ import annotations

from ertskin.calibration.fit import fit_recording
from ertskin.calibration.result import Calibration
from ertskin.library.source import RecordingSource, recording_of


def calibrate(recording: RecordingSource, *, method: str = "gauss_newton", resolution: str = "fast") -> Calibration:
    """Fit whatever a recording, or the file at a path, allows (paper III): what it can't tell stays None.

    The support's stiffness from the rigid block, the moduli from depths and forces, the piezoresistive law from the
    specimen, sheet and contact resistances from the rest frames.

    Args:
        recording: a recording in memory, or the path of one.
        method: "gauss_newton", or "direct_search" as in the paper.
        resolution: "fast" or "fine": how finely the sheet is meshed.

    Raises:
        UserError: for an unknown method, or where there is nothing to calibrate on.
        RecordingError: where the file can't be read.
    """
    read, name = recording_of(recording)
    return fit_recording(read, name, method, resolution)[0]
