"""How well the model fits: the calibrated numbers, and the paper's Figs. 4, 6, 7 and 8 for this sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ertskin.calibration.drawing import FIGURES
from ertskin.calibration.result import Calibration
from ertskin.report.figures.image import data_uri
from ertskin.report.page import Picture, Section
from ertskin.report.words import name_in_words

WIDE = ("contact_resistance", "model_error_cases")


def fit(calibration: Calibration, figures: Path | None) -> Section:
    """Calibrated numbers, and the pictures ``ertskin calibrate`` left in the folder ``figures``."""
    words = [
        "The simulator's numbers were fitted to the recording: the support's stiffness and the layers' moduli from "
        "force and depth, the piezoresistive law from the specimen, one contact resistance per electrode from the "
        "scan at rest.",
    ]
    pictures = [] if figures is None else _pictures(figures)
    if not pictures:
        words.append("No pictures of the fit were kept: ertskin calibrate draws them.")
    return Section("How well the model fits", tuple(words), _facts(calibration), pictures=tuple(pictures))


def _pictures(folder: Path) -> list[Picture]:
    drawn = [(name, folder / f"{name}.png") for name in FIGURES]
    return [Picture(data_uri(path.read_bytes()), FIGURES[name], name in WIDE) for name, path in drawn if path.is_file()]


def _facts(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    facts = [("recording", calibration.recording)]
    sensor = calibration.sensor
    if sensor is not None:
        facts += [
            (f"modulus of {name_in_words(layer.name)}", f"{1e-3 * layer.youngs_modulus_pa:.4g} kPa")
            for layer in sensor.layers
        ]
        facts.append(("sheet resistance", f"{1e-3 * sensor.sheet_resistance_ohm_sq:.4g} kΩ/sq"))
    if calibration.foam_modulus_pa is not None:
        facts.append(("modulus of the foam coupon", f"{1e-3 * calibration.foam_modulus_pa:.4g} kPa"))
    if calibration.indenter_n_per_m is not None:
        facts.append(("stiffness of the indenter's support", f"{1e-3 * calibration.indenter_n_per_m:.4g} N/mm"))
    if calibration.contact_resistance_ohm is not None:
        low, middle, high = np.percentile(calibration.contact_resistance_ohm, [0, 50, 100])
        facts.append(("contact resistances", f"median {middle:.4g} Ω, from {low:.4g} to {high:.4g} Ω"))
    if calibration.noise_v is not None:
        facts.append(("noise of one reading", f"{1e3 * calibration.noise_v:.3g} mV"))
    return tuple(facts)
