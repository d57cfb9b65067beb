"""A pad whose contact resistance runs to nothing at rest: no contact is that good, it lies nearer to the others.

So far from its place it can't be found by derivatives at its nominal place, where its contact hides it.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.linear.sensitivity import PadRims
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.effects.effect import ElectrodeEffect
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.registry import measured_as
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

VANISHED = 0.02
"""Part of the median contact resistance below which a contact is better than any is."""
LIKELY = 1.0
"""Standard deviation in which contact resistances are taken to differ, in their logarithm."""
ROUNDS = 12
LONGEST_M, STILL_M = 1.5e-3, 2e-5
"""Longest step of a pad, and the one from which on it stays."""


def displaced_pad(
    skin: Skin,
    rest_v: Array,
    noise_v: float,
    misfit: float,
    criteria: Criteria,
    resolution: str | Resolution = "fine",
) -> ElectrodeEffect | None:
    """The pad with the best contact of all, moved to where it fits the resting scan; None where no pad need be.

    ``skin`` is calibrated to the mean resting scan ``rest_v`` (P,) with noise ``noise_v``, which left it ``misfit``.
    """
    contacts = skin.contact_resistance_ohm
    electrode = int(np.argmin(contacts))
    usual = float(np.median(contacts))
    if contacts[electrode] > VANISHED * usual or skin.sensor.electrode_edge_m is not None:
        return None
    start = np.where(np.arange(len(contacts)) == electrode, usual, contacts)
    most = (1 - criteria.most_share) * misfit**2
    try:
        return _moved(skin, electrode, start, rest_v / noise_v, noise_v, most, resolution)
    except (MeshError, np.linalg.LinAlgError):
        return None


def _moved(
    skin: Skin,
    electrode: int,
    contact_ohm: Array,
    rest: Array,
    noise_v: float,
    most: float,
    resolution: str | Resolution,
) -> ElectrodeEffect | None:
    """Gauss-Newton in the logarithms of contact and sheet resistances and the pad's place, on a new mesh every time.

    ``rest`` (P,) is over its noise. A mean square misfit of more than ``most`` is none that a place explains.
    """
    zero, count, usual_ohm = skin.piezo.zero_ohm_sq, len(contact_ohm), contact_ohm[electrode]
    place = measured_as(Measured.PAD_SHIFT)().changed({"electrode": electrode})
    known = place.reading_starts(skin.sensor, skin.protocol)[electrode].along
    farthest_m = min(place.known(key).high for key in known)
    shift_m = np.zeros(2)
    unlikely = np.zeros(count + 3)
    unlikely[electrode] = 1 / LIKELY
    for _ in range(ROUNDS):
        if np.abs(shift_m).max() > farthest_m:
            return None
        effect = cast(ElectrodeEffect, place.changed(dict(zip(known, shift_m.tolist(), strict=True))))
        scan, columns = (part / noise_v for part in _scan(skin, effect, electrode, zero, contact_ohm, resolution))
        wrong = rest - scan
        wanted = np.append(wrong, np.log(usual_ohm / contact_ohm[electrode]) / LIKELY)
        step = np.linalg.lstsq(np.vstack([columns, unlikely]), wanted, rcond=None)[0]
        if np.abs(step[count + 1 :]).max() < STILL_M:
            return effect if float(np.mean(wrong**2)) < most else None
        contact_ohm = contact_ohm * np.exp(np.clip(step[:count], -1.0, 1.0))
        zero *= float(np.exp(np.clip(step[count], -0.3, 0.3)))
        shift_m = shift_m + np.clip(step[count + 1 :], -LONGEST_M, LONGEST_M)
    return None


def _scan(
    skin: Skin,
    effect: ElectrodeEffect,
    electrode: int,
    zero_ohm_sq: float,
    contact_ohm: Array,
    resolution: str | Resolution,
) -> tuple[Array, Array]:
    """The resting scan (P,) with the pad moved and its derivatives (P,L+3) by what ``_moved`` fits, in volt."""
    sheet = SheetModel(effect.geometry(skin.sensor), resolution)
    solution = sheet.solve(sheet.uniform(zero_ohm_sq), contact_ohm)
    slope = skin.protocol.whitened(solution.jacobian_contact_resistance().T).T
    scan = skin.protocol.whitened(solution.pair_resistance_ohm)
    pads = PadRims(sheet).sensitivity(solution, skin.protocol)[:, electrode]
    return scan, np.column_stack([slope * contact_ohm, scan - slope @ contact_ohm, pads])
