"""The touches of a recording: changes against rest, beside what the stage and the load cell say."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ertskin.data.baseline import others_weights, rest_weights
from ertskin.errors import UserError
from ertskin.hardware.recording import Recording
from ertskin.physics.calibration.following import RestingSkin, followed, surprises
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import completed, despiked

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Touches:
    """N touched frames of a recording; C contacts, P pairs of electrodes, R readings.

    ``change_v`` (N,P): whitened coordinates of the change, spikes left out. ``readings_v`` (N,R): the raw change, as
    it was read, nought where no reading is taken. ``history``: the frames' contacts, depths and forces. ``rest_v``
    (T,K,M): the rest frames as read; ``rest_zero`` (T,T): weights of the others in the zero of each.
    ``zero_variance`` (N,): of the zero that changes count from, in units of a frame's noise. Frames that have lost
    more readings than the others can tell are left out.
    """

    protocol: Protocol
    change_v: Array
    readings_v: NDArray[np.float32]
    history: History
    rest_v: Array
    rest_zero: Array
    zero_variance: Array

    def __len__(self) -> int:
        return len(self.change_v)

    @property
    def rest_frames(self) -> int:
        """How many rest frames there are."""
        return len(self.rest_v)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Touches:
        """The frames selected."""
        return Touches(
            self.protocol,
            self.change_v[rows],
            self.readings_v[rows],
            self.history[rows],
            self.rest_v,
            self.rest_zero,
            self.zero_variance[rows],
        )

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
    protocol, history, voltage, coordinates = _whole_frames(recording)
    weights = rest_weights(history, coordinates)
    rest = history.phase == 0
    touched = np.asarray(history.touched.any(axis=1))
    if rests:
        touched |= rest & np.isin(history.press, history.press[touched])
    flat = voltage.reshape(len(voltage), -1)
    change = coordinates - weights @ coordinates[rest]
    raw = flat[touched] - weights[touched] @ flat[rest]
    variance = (weights[touched] ** 2).sum(axis=1)
    others = others_weights(history.time_s[rest], coordinates[rest])
    return Touches(protocol, change[touched], raw.astype(np.float32), history[touched], voltage[rest], others, variance)


def followed_touches(recording: Recording, skin: RestingSkin) -> tuple[Touches, Followed]:
    """Every frame of ``recording`` with a contact, as it would have read on the skin at its calibration: changes from
    the zero that its rest frames tell, over the sheet's gain; and what became of the skin.

    Raises ``UserError`` where frames, protocol or rest frames are missing, or the scan is another one than the skin's.
    """
    protocol, history, voltage, coordinates = _whole_frames(recording)
    if coordinates.shape[1:] != skin.rest_v.shape:
        raise UserError("the recording was scanned with another protocol than the skin was calibrated with")
    rest, touched = np.asarray(history.phase == Phase.REST), np.asarray(history.touched.any(axis=1))
    if not rest.any():
        raise UserError("the recording has no rest frame (phase 0) to count changes from")
    states = followed(skin, coordinates[rest], history.time_s[rest], history.time_s[touched])
    zero = np.array([state.zero_v for state in states]).reshape(-1, len(skin.rest_v))
    gain = np.array([state.gain for state in states])
    flat = voltage.reshape(len(voltage), -1)
    # What no resistor network could give has no part in the skin's wandering.
    unexplained = protocol.split(voltage[rest].mean(axis=0))[1].ravel()
    change = (coordinates[touched] - zero) / gain[:, None]
    raw = (flat[touched] - unexplained - zero @ protocol.orthonormal.T) / gain[:, None]
    variance = np.array([state.zero_variance for state in states])
    others = others_weights(history.time_s[rest], coordinates[rest])
    touches = Touches(protocol, change, raw.astype(np.float32), history[touched], voltage[rest], others, variance)
    return touches, _course(skin, coordinates[rest], history.time_s[rest])


@dataclass(frozen=True)
class Followed:
    """What rest frames say of a skin since its calibration: largest relative changes of the sheet and of a contact, and
    how many of the ``frames`` rest frames fit what was followed no longer."""

    sheet: float
    contact: float
    strange: int
    frames: int


def _course(skin: RestingSkin, rest_v: Array, rest_s: Array) -> Followed:
    changes = np.array([state.change for state in followed(skin, rest_v, rest_s, rest_s)])
    if not changes.size:
        return Followed(0.0, 0.0, 0, len(rest_v))
    strange = sum(square > skin.limit for square, _ in surprises(skin, rest_v, rest_s))
    contact = np.abs(changes[:, :-1]).max(initial=0.0)
    return Followed(float(np.abs(changes[:, -1]).max()), float(contact), strange, len(rest_v))


_WHOLE: WeakKeyDictionary[Recording, tuple[Protocol, History, Array, Array]] = WeakKeyDictionary()


def _whole_frames(recording: Recording) -> tuple[Protocol, History, Array, Array]:
    """Protocol, and of the frames that are whole history, readings (T,K,M) and whitened coordinates (T,n).

    Kept as long as the recording is: looking for spikes takes longest, and every network asks for the same frames.
    """
    if (kept := _WHOLE.get(recording)) is not None:
        return kept
    if recording.frames is None or recording.protocol is None:
        raise UserError("the recording has no frames with a protocol: nothing to learn touches from")
    protocol, voltage = recording.protocol, np.asarray(recording.frames.voltage_v, dtype=float)
    coordinates, _ = despiked(protocol, voltage)
    voltage = completed(protocol, voltage)
    whole = np.asarray(np.isfinite(voltage).all(axis=(1, 2)))
    found = protocol, recording.frames.history[whole], voltage[whole], coordinates[whole]
    _WHOLE[recording] = found
    return found
