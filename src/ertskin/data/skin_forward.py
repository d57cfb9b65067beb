"""The calibrated skin as a forward model that travels to workers, built or to be built there."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration import Calibration
from ertskin.cores import given_cores
from ertskin.data.forward import PressForward
from ertskin.data.trial_forward import TrialForward
from ertskin.errors import UserError
from ertskin.physics.conduction.sheet import Resolution
from ertskin.physics.effects.registry import build_effects
from ertskin.physics.protocol import Protocol
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]


class SkinForward:
    """Presses on a calibrated skin with ``effects`` ({name: {parameter: value}}), built when first asked.

    With ``places_m`` (C,2) presses there, up to ``max_force_n``, are put together from single ones (``TrialForward``),
    of which so many ``trials`` will be asked; all others are solved (``PressForward``).
    """

    def __init__(
        self,
        calibration: Calibration,
        protocol: Protocol,
        effects: dict[str, Any],
        resolution: str,
        places_m: Array | None = None,
        max_force_n: float = 0.0,
        trials: int = 0,
    ) -> None:
        self.calibration, self.protocol, self.effects, self.resolution = calibration, protocol, effects, resolution
        self.places_m, self.max_force_n, self.trials = places_m, max_force_n, trials

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        return self.built.change_ohm(contact_m, force_n)

    def prepare(self) -> None:
        """Build it here and now, on all cores."""
        cores = given_cores()
        self.built = self._built(cores)
        if isinstance(self.built, TrialForward):
            self.built.solver.tabulate(cores)

    @cached_property
    def built(self) -> PressForward | TrialForward:
        """The forward model, tables and all."""
        return self._built(1)

    def _built(self, workers: int) -> PressForward | TrialForward:
        if self.places_m is None:
            return self._pressed(self.resolution)
        return TrialForward(
            self._pressed, self.resolution, self.places_m, self.max_force_n, self.trials, workers=workers
        )

    def _pressed(self, resolution: str | Resolution) -> PressForward:
        return PressForward(skin_of(self.calibration, self.protocol, self.effects, resolution))


def skin_of(
    calibration: Calibration, protocol: Protocol, effects: dict[str, Any], resolution: str | Resolution
) -> Skin:
    """The calibrated skin with its effects; ``UserError`` where the calibration lacks a part or an effect is wrong."""
    if calibration.law is None or calibration.contact_resistance_ohm is None:
        lacking = "piezoresistive law" if calibration.law is None else "contact resistances"
        raise UserError(f"{calibration.recording}: its calibration has no {lacking}; the recording can't tell them")
    if not calibration.known_sensor.layers:
        raise UserError(f"{calibration.recording}: has no layers, so pressure can't be simulated")
    try:
        built = build_effects(effects)
    except ValueError as error:
        raise UserError(str(error)) from None
    return Skin.build(
        calibration.known_sensor,
        protocol,
        calibration.law,
        calibration.contact_resistance_ohm,
        calibration.indenter_n_per_m or np.inf,
        built,
        resolution,
    )
