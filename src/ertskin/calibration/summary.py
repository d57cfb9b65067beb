"""A calibration as a table on the terminal."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table

from ertskin.calibration.fit import Fits
from ertskin.calibration.model_error import ModelError
from ertskin.calibration.result import Calibration
from ertskin.physics.calibration.contact_resistance import ContactFit
from ertskin.physics.calibration.rest_frames import RestScan
from ertskin.report.words import name_in_words


def print_summary(console: Console, calibration: Calibration, fits: Fits, error: ModelError | None) -> None:
    """Print every number fitted, with its error."""
    table = Table(title=calibration.recording, show_header=False, title_justify="left")
    if fits.support is not None:
        table.add_row(
            "indenter support",
            f"{fits.support.stiffness_n_per_m:.0f} ± {fits.support.standard_error_n_per_m:.1f} N/m",
        )
    if fits.moduli is not None:
        table.add_row(
            "pad stiffness",
            f"{fits.moduli.stiffness_n_per_m:.0f} ± {fits.moduli.stiffness_standard_error_n_per_m:.1f} N/m, "
            f"depth misfit {1e6 * fits.moduli.depth_rms_m:.0f} µm rms",
        )
        found = zip(fits.moduli.names, fits.moduli.moduli_pa, strict=True)
        moduli = ", ".join(f"{name_in_words(name)} {1e-3 * modulus_pa:.4g} kPa" for name, modulus_pa in found)
        table.add_row("moduli", f"{moduli} (force and depth fix one combination)")
    if fits.specimen is not None:
        table.add_row(
            "piezoresistive law",
            f"up to {1e-3 * fits.specimen.law.max_stress_pa:.0f} kPa, "
            f"hysteresis {100 * fits.specimen.hysteresis:.2f} %, misfit {100 * fits.specimen.residual_fraction:.2f} %",
        )
    for fit in (fits.contacts, fits.contacts_searched):
        if fit is not None:
            _contact_rows(table, fit)
    if fits.coupon is not None:
        table.add_row(
            "foam coupon",
            f"first loading {1e-3 * fits.coupon.first_pa:.1f} kPa, later "
            f"{1e-3 * fits.coupon.cycled_pa:.1f} ± {1e-3 * fits.coupon.cycled_standard_error_pa:.1f} kPa, "
            f"{fits.coupon.loadings} loadings",
        )
    if fits.rest is not None:
        table.add_row("noise of a reading", _noise(fits.rest))
    if error is not None:
        table.add_row(
            "model error on presses",
            f"{1e3 * np.sqrt(np.mean(error.rmse_v**2)):.2f} mV rms over {len(error.force_n)} frames",
        )
    console.print(table)


def _noise(rest: RestScan) -> str:
    if not np.isfinite(rest.noise_v):
        return "unknown: it takes two rest frames"
    return f"{1e3 * rest.noise_v:.3f} mV over {rest.frames} rest frames"


def _contact_rows(table: Table, fit: ContactFit) -> None:
    table.add_row(
        f"contacts, {name_in_words(fit.method)}",
        f"sheet {fit.sheet_resistance_ohm_sq:.1f} ± {fit.sheet_standard_error_ohm_sq:.1f} Ω/sq, rest readings "
        f"{1e3 * fit.rms_before_v:.1f} -> {1e3 * fit.rms_after_v:.3f} mV rms, "
        f"{fit.evaluations} evaluations, {fit.seconds:.2f} s",
    )
    ohm = ", ".join(f"{r:.1f}" for r in fit.contact_resistance_ohm)
    table.add_row("  contact resistances / Ω", ohm)
