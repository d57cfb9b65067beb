"""A calibration as YAML a person can read and edit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ertskin.calibration.result import Calibration
from ertskin.errors import UserError
from ertskin.files import write_whole
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.sensor import Layer, Sensor

FORMAT = "ertskin-calibration"
VERSION = 1
_ARRAYS = ("outline_m", "electrode_center_m", "electrode_size_m", "electrode_edge_m", "taxel_m", "indenter_points_m")
_NUMBERS = ("sheet_resistance_ohm_sq", "contact_resistance_guess_ohm", "indenter_diameter_m", "pad_margin_m")


def save_calibration(path: Path, calibration: Calibration) -> None:
    """Write ``calibration`` aside and rename it into place."""
    write_whole(path, yaml.safe_dump(_as_builtins(calibration), sort_keys=False, width=110))


def load_calibration(path: Path) -> Calibration:
    """Read what ``save_calibration`` wrote; ``UserError`` names the file and what is wrong with it."""
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such calibration; make one with: ertskin calibrate recording=FILE") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UserError(f"{path}: can't be read as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise UserError(f"{path}: is no calibration: expected a first line 'format: {FORMAT}'")
    if found.get("format_version") != VERSION:
        raise UserError(f"{path}: format_version is {found.get('format_version')}, this program reads {VERSION}")
    try:
        return _calibration(found)
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{path}: {type(error).__name__.removesuffix('Error').lower()} error at {error}") from None


def _as_builtins(calibration: Calibration) -> dict[str, Any]:
    law = calibration.law
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "recording": calibration.recording,
        "noise_v": _number(calibration.noise_v),
        "indenter_n_per_m": _number(calibration.indenter_n_per_m),
        "contact_resistance_ohm": _list(calibration.contact_resistance_ohm),
        "contact_resistance_error_ohm": _list(calibration.contact_resistance_error_ohm),
        "law": None
        if law is None
        else {
            "zero_ohm_sq": float(law.zero_ohm_sq),
            "max_stress_pa": float(law.max_stress_pa),
            "coefficients": _list(law.coefficients),
        },
        "foam_modulus_pa": _number(calibration.foam_modulus_pa),
        "notes": {name: float(value) for name, value in calibration.notes.items()},
        "sensor": None if calibration.sensor is None else _sensor_as_builtins(calibration.sensor),
    }


def _sensor_as_builtins(sensor: Sensor) -> dict[str, Any]:
    numbers = {name: float(getattr(sensor, name)) for name in _NUMBERS}
    layers = [
        {
            "name": layer.name,
            "thickness_m": float(layer.thickness_m),
            "youngs_modulus_pa": float(layer.youngs_modulus_pa),
            "poissons_ratio": float(layer.poissons_ratio),
        }
        for layer in sensor.layers
    ]
    arrays = {name: _list(getattr(sensor, name)) for name in _ARRAYS}
    return {**numbers, "piezo_interface": int(sensor.piezo_interface), "layers": layers, **arrays}


def _calibration(found: dict[str, Any]) -> Calibration:
    law = found["law"]
    return Calibration(
        recording=str(found["recording"]),
        sensor=None if found["sensor"] is None else _sensor(dict(found["sensor"])),
        law=None if law is None else PiezoPolynomial(**{**law, "coefficients": np.array(law["coefficients"])}),
        contact_resistance_ohm=_vector(found["contact_resistance_ohm"]),
        contact_resistance_error_ohm=_vector(found["contact_resistance_error_ohm"]),
        indenter_n_per_m=found["indenter_n_per_m"],
        noise_v=found["noise_v"],
        foam_modulus_pa=found.get("foam_modulus_pa"),
        notes=dict(found["notes"]),
    )


def _sensor(found: dict[str, Any]) -> Sensor:
    arrays = {name: _points(name, found.pop(name)) for name in _ARRAYS}
    layers = tuple(Layer(**layer) for layer in found.pop("layers"))
    return Sensor(**found, **arrays, layers=layers)  # type: ignore[arg-type]


def _points(name: str, value: Any) -> np.ndarray | None:
    if name == "electrode_edge_m":
        return None if value is None else np.array(value, dtype=float)
    return np.array(value, dtype=float).reshape(-1, 2)


def _vector(value: Any) -> np.ndarray | None:
    return None if value is None else np.array(value, dtype=float)


def _number(value: float | None) -> float | None:
    return None if value is None else float(value)


def _list(value: Any) -> Any:
    return None if value is None else np.asarray(value, dtype=float).tolist()
