"""How far the calibrated model is from the recording's presses (paper III-D, Fig. 8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.data.skin_forward import SkinForward
from ertskin.data.touches import Touches

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelError:
    """Of N one-point frames: ``force_n``, ``taxel`` (the nearest, -1 without any), ``rmse_v`` of the readings' changes.

    ``worst`` and ``best``: measured and simulated changes (R,) of the frames with the largest and smallest error
    among those at full depth, with their names.
    """

    force_n: Array
    taxel: NDArray[np.intp]
    rmse_v: Array
    measured_v: Array
    simulated_v: Array
    names: tuple[str, str]

    def per_taxel_v(self, taxels: int) -> Array:
        """(n,) rms error of each taxel's frames, NaN where none was pressed."""
        error = np.full(taxels, np.nan)
        for k in np.unique(self.taxel):
            error[k] = np.sqrt(np.mean(self.rmse_v[self.taxel == k] ** 2))
        return error


def model_error(forward: SkinForward, touches: Touches) -> ModelError:
    """Compare every one-point frame of ``touches`` with ``forward``."""
    single = touches[np.flatnonzero(touches.history.touched.sum(axis=1) == 1)]
    force, place = single.history.force_n[:, 0], single.history.contact_m[:, 0]
    protocol = single.protocol
    change = forward.change_ohm(single.history.contact_m, single.history.force_n)
    simulated = protocol.readings(change).reshape(len(single), -1)
    measured = (single.change_v @ protocol.orthonormal.T).astype(float)
    rmse = np.sqrt(np.mean((measured - simulated) ** 2, axis=1))
    taxel_m = forward.calibration.known_sensor.taxel_m
    away = np.linalg.norm(place[:, None] - taxel_m, axis=-1)
    taxel = away.argmin(axis=1) if len(taxel_m) else np.full(len(place), -1)
    deep = np.flatnonzero(force > 0.9 * force.max())
    ends = deep[[rmse[deep].argmax(), rmse[deep].argmin()]]
    names = [f"({1e3 * place[k][0]:.0f}, {1e3 * place[k][1]:.0f}) mm, {force[k]:.1f} N" for k in ends]
    return ModelError(force, taxel, rmse, measured[ends], simulated[ends], (names[0], names[1]))
