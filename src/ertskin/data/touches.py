"""The touches of a recording: changes against rest, beside what the stage and the load cell say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.data.baseline import rest_weights
from ertskin.errors import UserError
from hardware.recording import Recording
from physics.history import History
from physics.protocol import Protocol
from physics.spikes import despiked

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Touches:
    """N touched frames of a recording; C contacts, P pairs of electrodes, R readings.

    ``change_v`` (N,P): whitened coordinates of the change, spikes left out. ``readings_v`` (N,R): the raw change, as
    it was read. ``history``: the frames' contacts, depths and forces. ``rest_v`` (T,K,M): the rest frames as read.
    """

    protocol: Protocol
    change_v: Array
    readings_v: NDArray[np.float32]
    history: History
    rest_v: Array

    def __len__(self) -> int:
        return len(self.change_v)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Touches:
        """The frames selected."""
        return Touches(self.protocol, self.change_v[rows], self.readings_v[rows], self.history[rows], self.rest_v)

    def force_map_n(self, taxel_m: Array, within_m: float) -> Array:
        """(N,n) load-cell force on the taxel nearest to each contact.

        ``UserError`` where a contact is further than ``within_m`` from every taxel: it belongs to another grid.
        """
        frames, slots = np.nonzero(np.isfinite(self.history.force_n) & self.history.touched)
        place = self.history.contact_m[frames, slots]
        away = np.linalg.norm(place[:, None] - taxel_m, axis=-1)
        if len(away) and away.min(axis=1).max() > within_m:
            worst = away.min(axis=1).argmax()
            x, y = 1e3 * place[worst]
            raise UserError(
                f"frame {frames[worst]}: the contact at ({x:.1f}, {y:.1f}) mm is "
                f"{1e3 * away[worst].min():.1f} mm from the nearest taxel of this grid; choose the recording's grid"
            )
        label = np.zeros((len(self), len(taxel_m)))
        np.add.at(label, (frames, away.argmin(axis=1)), self.history.force_n[frames, slots])
        return label


def touches_of(recording: Recording, *, rests: bool = False) -> Touches:
    """Every frame of ``recording`` with a contact; with ``rests`` also the rest frame before each press.

    Raises ``UserError`` where frames, protocol or rest frames are missing.
    """
    if recording.frames is None or recording.protocol is None:
        raise UserError("the recording has no frames with a protocol: nothing to learn touches from")
    history, protocol = recording.frames.history, recording.protocol
    voltage = np.asarray(recording.frames.voltage_v, dtype=float)
    coordinates, _ = despiked(protocol, voltage)
    weights = rest_weights(history, coordinates)
    rest = history.phase == 0
    touched = np.asarray(history.touched.any(axis=1))
    if rests:
        touched |= rest & np.isin(history.press, history.press[touched])
    flat = voltage.reshape(len(voltage), -1)
    change = coordinates - weights @ coordinates[rest]
    raw = flat[touched] - weights[touched] @ flat[rest]
    return Touches(protocol, change[touched], raw.astype(np.float32), history[touched], voltage[rest])
