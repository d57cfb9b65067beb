"""The calibration that was fitted together with the effects found: without it they would be added to numbers that had
already bent to make up for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ertskin.calibration.result import Calibration
from ertskin.calibration.store import save_calibration
from ertskin.data.sources import calibration_folder, joint_calibration_name
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.linear.calibration_vector import stiffened
from ertskin.physics.effects.registry import effects_config


def write_joint_calibration(root: Path, source: Path, findings: Findings) -> Path | None:
    """Keep it beside the own calibration of ``source`` below ``root``, where commands that simulate those effects look.

    None where no effects were named, or the recording is of no skin.
    """
    calibration = joint_calibration(findings)
    if calibration is None:
        return None
    name = joint_calibration_name(effects_config(findings.diagnosis.effects))
    path = calibration_folder(root, source) / name
    save_calibration(path, calibration)
    return path


def joint_calibration(findings: Findings) -> Calibration | None:
    """Law, moduli and contact resistances of the fit that the names come from; None where there is none."""
    selection = findings.handed_on
    if selection is None or findings.evidence is None or not findings.diagnosis.effects:
        return None
    solved, family = selection.after, selection.problem.family
    fitted, first = solved.calibration, family.first
    sensor = stiffened(first.sensor, fitted.log_ratio, first.pad_n_per_m)
    support = first.support_n_per_m
    return Calibration(
        findings.diagnosis.recording,
        replace(sensor, sheet_resistance_ohm_sq=fitted.zero_ohm_sq),
        family.skin(fitted, ()).piezo,
        fitted.contact_ohm,
        indenter_n_per_m=support if support < float("inf") else None,
        noise_v=findings.evidence.noise_v,
    )
