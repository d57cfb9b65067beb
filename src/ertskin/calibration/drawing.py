"""The paper's Figs. 4, 6, 7 and 8 for a calibrated recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from ertskin.calibration.fit import Fits, single_presses
from ertskin.calibration.model_error import ModelError
from ertskin.calibration.result import Calibration
from ertskin.hardware.recording import Recording
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.history import Phase
from ertskin.physics.mechanics.stiffness import force_n
from ertskin.report.figures.contact_resistance_fit import contact_resistance_fit
from ertskin.report.figures.error_surface import error_surface
from ertskin.report.figures.force_depth import force_depth
from ertskin.report.figures.model_error_by_force import model_error_by_force
from ertskin.report.figures.model_error_cases import model_error_cases
from ertskin.report.figures.specimen import specimen
from ertskin.report.figures.taxel_map import taxel_map

FIGURES = {
    "force_depth": "Force against commanded depth, and the rigid block (III-A, III-B)",
    "specimen": "Compression test of the specimen and the fifth-order law (Fig. 4)",
    "error_surface": "Depth error over the two moduli (Fig. 6)",
    "contact_resistance": "All readings at rest, before and after fitting the contact resistances (Fig. 7)",
    "model_error_map": "Model error per taxel (Fig. 8a)",
    "model_error_force": "Model error against force (Fig. 8b)",
    "model_error_cases": "Largest and smallest model error (Fig. 8c)",
}


def calibration_figures(
    recording: Recording, calibration: Calibration, fits: Fits, error: ModelError | None, resolution: str
) -> Iterator[tuple[str, Figure]]:
    """(name of ``FIGURES``, figure) for every one the recording allows."""
    if fits.moduli is not None:
        yield "force_depth", _force_depth(recording, fits)
    if fits.specimen is not None and recording.specimen is not None:
        stress = np.linspace(0, fits.specimen.law.max_stress_pa, 200)
        law = fits.specimen.law.sheet_resistance_ohm_sq(stress)
        yield (
            "specimen",
            specimen(recording.specimen.stress_pa, recording.specimen.sheet_resistance_ohm_sq, stress, law),
        )
    if fits.surface is not None and fits.moduli is not None:
        best = (float(fits.moduli.moduli_pa[0]), float(fits.moduli.moduli_pa[1]))
        yield "error_surface", error_surface(*fits.surface.moduli_pa, fits.surface.rms_m, best, fits.surface.names)
    if fits.contacts is not None and fits.rest is not None:
        yield "contact_resistance", _contact_resistance(recording, calibration, fits, resolution)
    if error is not None:
        taxel_m = calibration.known_sensor.taxel_m
        if len(taxel_m):
            yield (
                "model_error_map",
                taxel_map(taxel_m, 1e3 * error.per_taxel_v(len(taxel_m)), "RMSE of the voltage change / mV"),
            )
        yield "model_error_force", model_error_by_force(error.force_n, error.rmse_v, calibration.noise_v)
        yield "model_error_cases", model_error_cases(error.measured_v, error.simulated_v, error.names)


def _force_depth(recording: Recording, fits: Fits) -> Figure:
    assert recording.frames is not None
    assert fits.moduli is not None
    depth, force, _ = single_presses(recording)
    history = recording.frames.history
    known = np.isfinite(history.depth_m[:, 0]) & np.isfinite(history.force_n[:, 0])
    used = (history.touched.sum(axis=1) == 1) & history.touched[:, 0] & known
    support = np.inf if fits.support is None else fits.support.stiffness_n_per_m
    line = np.linspace(0, depth.max(), 50)
    block = recording.rigid_block
    return force_depth(
        depth,
        force,
        line,
        force_n(line, fits.moduli.stiffness_n_per_m, support),
        history.phase[used] == Phase.UNLOADING,
        None if block is None else block.depth_m,
        None if block is None else block.force_n,
    )


def _contact_resistance(recording: Recording, calibration: Calibration, fits: Fits, resolution: str) -> Figure:
    assert recording.sensor is not None
    assert recording.protocol is not None
    assert fits.rest is not None
    assert fits.contacts is not None
    start, protocol = recording.sensor, recording.protocol
    sheet = SheetModel(start, resolution)
    before = sheet.solve(sheet.uniform(start.sheet_resistance_ohm_sq), start.contact_resistance_guess_ohm)  # type: ignore[arg-type]
    after = sheet.solve(sheet.uniform(fits.contacts.sheet_resistance_ohm_sq), fits.contacts.contact_resistance_ohm)
    return contact_resistance_fit(
        fits.rest.voltage_v,
        protocol.readings(before.pair_resistance_ohm),
        protocol.readings(after.pair_resistance_ohm),
    )
