"""What a calibrated skin would read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ertskin.calibration.result import Calibration
from ertskin.data.skin_forward import skin_of
from ertskin.hardware.measurement import Frames
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.registry import effects_config
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol


def simulate(
    calibration: Calibration,
    protocol: Protocol,
    history: History,
    effects: Mapping[str, Any] | Sequence[Effect] = (),
    *,
    noise_v: float = 0.0,
    seed: int = 0,
    resolution: str = "fast",
) -> Frames:
    """The scans of a history of presses on a calibrated skin, what was pressed before included.

    Args:
        calibration: of ``calibrate`` or ``load_calibration``; it must hold a law, contact resistances and layers.
        protocol: which currents go in and which voltages are read: K injections of M readings.
        history: T frames; ``History.of_presses`` makes one from places and forces. Forces count where they are known,
            depths where not.
        effects: ``{name: {parameter: value}}``, or effects such as those of a diagnosis.
        noise_v: standard deviation in volt of white noise on every reading; ``calibration.noise_v`` is the skin's own.
        seed: of the noise.
        resolution: "fast" or "fine": how finely the sheet is meshed.

    Returns:
        Frames with ``voltage_v`` (T,K,M) in volt, which a ``Recording`` takes.

    Raises:
        UserError: where the calibration lacks a part, or an effect or one of its values doesn't exist.
    """
    chosen = dict(effects) if isinstance(effects, Mapping) else effects_config(effects)
    voltage = skin_of(calibration, protocol, chosen, resolution).readings_v(history)
    voltage = voltage + noise_v * np.random.default_rng(seed).standard_normal(voltage.shape)
    return Frames(voltage.astype(np.float32), history)
