"""Everything the bench can leave hidden in a skin: the named effects, in forms of its own, and some that bear no name.

A strength of 1 is a plainly visible effect, 0 is none. ``draw`` turns a strength into physical parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ertskin.hardware.virtual.bench.plans import QUICK_TAXELS
from ertskin.physics.sensor import Sensor

Parameters = dict[str, Any]
Draw = Callable[[float, np.random.Generator, Sensor], Parameters]


@dataclass(frozen=True)
class Effect:
    """One thing a skin may do that the baseline model leaves out.

    ``listed`` tells a name of the design's table from an effect that is in no list; ``local`` says it sits at a place,
    an electrode or a channel.
    """

    stage: str
    draw: Draw
    listed: bool = True
    local: bool = False


def _direction(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _spot(rng: np.random.Generator, sensor: Sensor) -> list[float]:
    """Near one of the places that every plan presses."""
    place = sensor.taxel_m[rng.choice(QUICK_TAXELS)] if len(sensor.taxel_m) == 36 else sensor.extent_m.mean(axis=0)
    return (place + rng.uniform(-4e-3, 4e-3, 2)).tolist()


def _nonlinear_foam(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"strain_per_m": 130.0 * strength, "alpha": rng.uniform(1.5, 3.0), "beta": 0.75}


def _viscoelastic_foam(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    shares = 0.12 * strength * rng.dirichlet([6.0, 6.0, 3.0])
    return {"shares": shares.tolist(), "times_s": (np.array([2.0, 11.0, 60.0]) * rng.uniform(0.7, 1.4, 3)).tolist()}


def _foam_hysteresis(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"loss": 0.1 * strength, "turn_m": rng.uniform(1.0e-4, 2.5e-4)}


def _foam_softening(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"amount": 0.12 * strength, "breadth": rng.uniform(0.2, 0.5)}


def _indenter_offset(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"shift_m": (6e-4 * strength * _direction(rng)).tolist(), "turn_rad": 6e-4 * strength * rng.uniform(-1, 1)}


def _piezo_hysteresis(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"width": 0.1 * strength}


def _piezo_creep(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"per_decade": 0.03 * strength, "half_pa": rng.uniform(4e3, 9e3)}


def _piezo_inhomogeneity(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"amplitude": 0.1 * strength, "field": int(rng.integers(2**31)), "length_m": rng.uniform(0.035, 0.06)}


def _sheet_anisotropy(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"log_ratio": 0.1 * strength, "angle_rad": rng.uniform(0, np.pi)}


def _sheet_inhomogeneity(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"amplitude": 0.03 * strength, "field": int(rng.integers(2**31)), "length_m": rng.uniform(0.035, 0.06)}


def _temperature_drift(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"final_share": -0.01 * strength * rng.choice([-1.0, 1.0]), "settle_s": rng.uniform(500.0, 2000.0)}


def _contact_pressure_dependence(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"exponent": 0.25 * strength, "pressure_pa": rng.uniform(1.5e3, 4e3)}


def _electrode_displacement(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    """The pad stays on the sheet, however strong the effect."""
    electrode = int(rng.integers(sensor.electrodes))
    center, room = sensor.electrode_center_m[electrode], sensor.electrode_size_m[electrode] / 2 + 3e-4
    low, high = sensor.extent_m
    moved = np.clip(center + 5e-4 * strength * _direction(rng), low + room, high - room)
    return {"electrode": electrode, "shift_m": (moved - center).tolist()}


def _channel_gain(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {
        "channel": int(rng.integers(sensor.electrodes)),
        "gain": 0.01 * strength * rng.choice([-1.0, 1.0]),
        "offset_v": 2e-3 * strength * rng.uniform(-1, 1),
    }


def _crosstalk(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"share": 0.003 * strength}


def _adc_saturation(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"below_top_share": 0.12 * strength, "knee_v": 0.01}


def _scan_skew(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"step_share": 0.6 * strength}


def _torn_patch(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {
        "center_m": _spot(rng, sensor),
        "radius_m": rng.uniform(0.008, 0.014),
        "lost_share": min(0.5 * strength, 0.95),
    }


def _delaminated_spot(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"center_m": _spot(rng, sensor), "radius_m": rng.uniform(0.010, 0.018), "gap_pa": 1500.0 * strength}


def _mains_hum(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    coupling = rng.uniform(0.3, 1.0, sensor.electrodes)
    return {"amplitude_v": 3e-3 * strength, "frequency_hz": 50.0, "coupling": coupling.tolist()}


def _schottky_electrode(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"electrode": int(rng.integers(sensor.electrodes)), "drop_v": 0.02 * strength, "knee_a": 4e-5}


def _humidity_film(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    film = rng.uniform(0.3, 1.7, sensor.electrodes)
    return {"conductance_s": (2e-7 * strength * film).tolist()}


def _stage_backlash(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"play_m": 1e-4 * strength}


def _frozen_channel(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"channel": int(rng.integers(sensor.electrodes)), "share": min(0.15 * strength, 0.9), "spell_frames": 6}


def _curved_amplifier(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"per_volt": 4e-4 * strength * rng.choice([-1.0, 1.0])}


def _self_heating(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"share": -0.002 * strength, "settle_scans": 0.4}


def _intermittent_electrode(strength: float, rng: np.random.Generator, sensor: Sensor) -> Parameters:
    return {"electrode": int(rng.integers(sensor.electrodes)), "jump_ohm": 60.0 * strength, "share": 0.3}


EFFECTS: dict[str, Effect] = {
    "nonlinear_foam": Effect("mechanics", _nonlinear_foam),
    "viscoelastic_foam": Effect("mechanics", _viscoelastic_foam),
    "foam_hysteresis": Effect("mechanics", _foam_hysteresis),
    "foam_softening": Effect("mechanics", _foam_softening),
    "indenter_offset": Effect("mechanics", _indenter_offset),
    "piezo_hysteresis": Effect("piezoresistance", _piezo_hysteresis),
    "piezo_creep": Effect("piezoresistance", _piezo_creep),
    "piezo_inhomogeneity": Effect("piezoresistance", _piezo_inhomogeneity),
    "sheet_anisotropy": Effect("conduction", _sheet_anisotropy),
    "sheet_inhomogeneity": Effect("conduction", _sheet_inhomogeneity),
    "temperature_drift": Effect("conduction", _temperature_drift),
    "contact_pressure_dependence": Effect("electrodes", _contact_pressure_dependence),
    "electrode_displacement": Effect("electrodes", _electrode_displacement, local=True),
    "channel_gain": Effect("acquisition", _channel_gain, local=True),
    "crosstalk": Effect("acquisition", _crosstalk),
    "adc_saturation": Effect("acquisition", _adc_saturation),
    "scan_skew": Effect("acquisition", _scan_skew),
    "torn_patch": Effect("piezoresistance", _torn_patch, listed=False, local=True),
    "delaminated_spot": Effect("mechanics", _delaminated_spot, listed=False, local=True),
    "stage_backlash": Effect("mechanics", _stage_backlash, listed=False),
    "humidity_film": Effect("electrodes", _humidity_film, listed=False),
    "schottky_electrode": Effect("electrodes", _schottky_electrode, listed=False, local=True),
    "intermittent_electrode": Effect("electrodes", _intermittent_electrode, listed=False, local=True),
    "self_heating": Effect("conduction", _self_heating, listed=False),
    "mains_hum": Effect("acquisition", _mains_hum, listed=False),
    "frozen_channel": Effect("acquisition", _frozen_channel, listed=False, local=True),
    "curved_amplifier": Effect("acquisition", _curved_amplifier, listed=False),
}
"""By name. The first seventeen are the design's; the rest are in no list that a diagnosis knows."""
