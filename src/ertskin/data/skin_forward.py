"""The calibrated skin as a forward model that travels to workers and is built there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration import Calibration
from ertskin.data.forward import PressForward
from ertskin.errors import UserError
from physics.effects.registry import build_effects
from physics.protocol import Protocol
from physics.skin import Skin

Array = NDArray[np.float64]


class SkinForward:
    """``PressForward`` of a calibrated skin with ``effects`` ({name: {parameter: value}}), built when first asked."""

    def __init__(self, calibration: Calibration, protocol: Protocol, effects: dict[str, Any], resolution: str) -> None:
        self.calibration, self.protocol, self.effects, self.resolution = calibration, protocol, effects, resolution
        self._built: PressForward | None = None

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        if self._built is None:
            self._built = PressForward(skin_of(self.calibration, self.protocol, self.effects, self.resolution))
        return self._built.change_ohm(contact_m, force_n)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}


def skin_of(calibration: Calibration, protocol: Protocol, effects: dict[str, Any], resolution: str) -> Skin:
    """The calibrated skin with its effects; ``UserError`` where the calibration lacks a part or an effect is wrong."""
    if calibration.law is None or calibration.contact_resistance_ohm is None:
        lacking = "piezoresistive law" if calibration.law is None else "contact resistances"
        raise UserError(f"{calibration.recording}: its calibration has no {lacking}; the recording can't tell them")
    if not calibration.sensor.layers:
        raise UserError(f"{calibration.recording}: has no layers, so pressure can't be simulated")
    try:
        built = build_effects(effects)
    except ValueError as error:
        raise UserError(str(error)) from None
    return Skin.build(
        calibration.sensor,
        protocol,
        calibration.law,
        calibration.contact_resistance_ohm,
        calibration.indenter_n_per_m or np.inf,
        built,
        resolution,
    )
