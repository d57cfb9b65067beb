"""The page of one calibration: what was recorded, the numbers fitted, the figures of the paper, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ertskin.calibration.result import Calibration
from ertskin.hardware.measurement import Recording
from ertskin.report.page import Page, Section, write_page
from ertskin.report.sections.fit import fit
from ertskin.report.sections.recorded import recorded

SUMMARY = (
    "The simulator's numbers as this recording has them. What the simulator still lacks after that, a diagnosis tells."
)


def write_calibration_page(
    folder: Path, source: Path, recording: Recording, calibration: Calibration, footer: Sequence[str] = ()
) -> Path:
    """``folder/report.html`` on the recording at ``source``, with the pictures drawn into ``folder`` before."""
    sections = [recorded({"recording": recording})] if recording.frames is not None else []
    commands = tuple(f"ertskin {verb} recording={source}" for verb in ("doctor", "diagnose", "train"))
    sections += [fit(calibration, folder), Section("What to do next", commands=commands)]
    title = f"Calibration on {calibration.recording}"
    return write_page(
        folder / "report.html", Page(title, SUMMARY, _key_numbers(calibration), tuple(sections), tuple(footer))
    )


def _key_numbers(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    numbers = []
    if calibration.sensor is not None:
        numbers.append((f"{1e-3 * calibration.sensor.sheet_resistance_ohm_sq:.4g} kΩ/sq", "sheet resistance"))
    if calibration.contact_resistance_ohm is not None:
        numbers.append((f"{np.median(calibration.contact_resistance_ohm):.3g} Ω", "median contact resistance"))
    if calibration.foam_modulus_pa is not None:
        numbers.append((f"{1e-3 * calibration.foam_modulus_pa:.3g} kPa", "modulus of the foam coupon"))
    if calibration.noise_v is not None:
        numbers.append((f"{1e3 * calibration.noise_v:.3g} mV", "noise of one reading"))
    return tuple(numbers)
