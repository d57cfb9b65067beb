"""How well the model fits: the paper's Figs. 4, 6, 7 and 8 for this sensor."""

from __future__ import annotations

import numpy as np

from ertskin.calibration.result import Calibration
from ertskin.report.figures.contact_resistance_fit import contact_resistance_fit
from ertskin.report.figures.error_surface import error_surface
from ertskin.report.figures.force_depth import force_depth
from ertskin.report.figures.model_error_by_force import model_error_by_force
from ertskin.report.figures.model_error_cases import model_error_cases
from ertskin.report.figures.specimen import specimen
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.model_fit import ChangeFit, ModelFit
from ertskin.report.page import Picture, Section


def fit(calibration: Calibration | None, model: ModelFit) -> Section:
    """Calibrated numbers, and every comparison of model and measurement that ``model`` holds."""
    pictures = [*_mechanics(model), *_rest(model), *(_change(model.change, model.noise_v) if model.change else ())]
    words = [
        "The simulator's numbers were fitted to the recording: the support's stiffness and the layers' moduli from "
        "force and depth, the piezoresistive law from the specimen, one contact resistance per electrode from the "
        "scan at rest.",
    ]
    if model.change is not None and model.noise_v is not None:
        times = float(np.sqrt(np.mean(model.change.rmse_v**2))) / model.noise_v
        words.append(
            f"Over all one-point frames the modelled change misses the measured one by {times:.2g} times the noise of "
            "a reading; at 1 nothing would be left to explain."
        )
    facts = () if calibration is None else _facts(calibration, model)
    return Section("How well the model fits", tuple(words), facts, pictures=tuple(pictures))


def _facts(calibration: Calibration, model: ModelFit) -> tuple[tuple[str, str], ...]:
    facts = [
        (f"modulus of {layer.name}", f"{1e-3 * layer.youngs_modulus_pa:.4g} kPa") for layer in calibration.sensor.layers
    ]
    facts.append(("sheet resistance", f"{1e-3 * calibration.sensor.sheet_resistance_ohm_sq:.4g} kΩ/sq"))
    if calibration.indenter_n_per_m is not None:
        facts.append(("stiffness of the indenter's support", f"{1e-3 * calibration.indenter_n_per_m:.4g} N/mm"))
    if calibration.contact_resistance_ohm is not None:
        low, middle, high = np.percentile(calibration.contact_resistance_ohm, [0, 50, 100])
        facts.append(("contact resistances", f"median {middle:.4g} Ω, from {low:.4g} to {high:.4g} Ω"))
    noise_v = calibration.noise_v if model.noise_v is None else model.noise_v
    if noise_v is not None:
        facts.append(("noise of one reading", f"{1e3 * noise_v:.3g} mV"))
    return tuple(facts)


def _mechanics(model: ModelFit) -> list[Picture]:
    pictures = []
    if (f := model.force_depth) is not None:
        drawn = force_depth(
            f.depth_m, f.force_n, f.model_depth_m, f.model_force_n, f.unloading, f.rigid_depth_m, f.rigid_force_n
        )
        pictures.append(Picture(drawn, "Force against commanded depth, measured and modelled."))
    if (s := model.specimen) is not None:
        drawn = specimen(s.stress_pa, s.sheet_resistance_ohm_sq, s.fit_stress_pa, s.fit_sheet_resistance_ohm_sq)
        pictures.append(Picture(drawn, "The specimen's sheet resistance against stress (paper's Fig. 4)."))
    if (e := model.error_surface) is not None:
        drawn = error_surface(e.soft_pa, e.stiff_pa, e.error_m, e.best_pa, e.names)
        pictures.append(Picture(drawn, "Error of the indentation depth over the moduli (paper's Fig. 6)."))
    return pictures


def _rest(model: ModelFit) -> list[Picture]:
    if (r := model.rest) is None:
        return []
    drawn = contact_resistance_fit(r.measured_v, r.guessed_v, r.fitted_v)
    words = "All readings at rest, before and after fitting the contact resistances (paper's Fig. 7)."
    return [Picture(drawn, words, wide=True)]


def _change(change: ChangeFit, noise_v: float | None) -> list[Picture]:
    rmse_v = change.rmse_v
    order = np.array([rmse_v.argmax(), rmse_v.argmin()])
    names = tuple(f"taxel {change.taxel[k]}, {change.force_n[k]:.1f} N" for k in order)
    by_taxel = taxel_map(change.taxel_m, 1e3 * change.rmse_by_taxel_v, "RMSE of the voltage change / mV")
    cases = model_error_cases(change.measured_v[order], change.model_v[order], (names[0], names[1]))
    return [
        Picture(by_taxel, "Error of the modelled voltage change by place (paper's Fig. 8 a)."),
        Picture(
            model_error_by_force(change.force_n, rmse_v, noise_v), "The same against the force (paper's Fig. 8 b)."
        ),
        Picture(cases, "The worst and the best frame (paper's Fig. 8 c).", wide=True),
    ]
