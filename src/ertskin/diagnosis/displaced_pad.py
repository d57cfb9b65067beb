"""Pads whose contact resistance runs to nothing at rest: no contact is that good, they lie nearer to the others.

A pad that far from its place can't be found by derivatives at its nominal place, where its contact hides it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.evidence import Evidence
from ertskin.diagnosis.sensitivity import PadRims
from physics.conduction.mesh import MeshError
from physics.effects.electrode_displacement import ElectrodeDisplacement
from physics.skin import Skin

Array = NDArray[np.float64]

VANISHED = 0.02
"""Part of the median contact resistance below which a contact is better than any is."""
LIKELY = 1.0
"""Standard deviation in which contact resistances are taken to differ, in their logarithm."""
ROUNDS = 12
LONGEST_M, STILL_M = 1.5e-3, 2e-5
"""Longest step of a pad, and the one from which on it stays."""
WORTH = 0.5
"""Part of the mean square misfit at rest that a displacement may leave."""


def displaced_pad(skin: Skin, evidence: Evidence, misfit: float) -> ElectrodeDisplacement | None:
    """The pad with the best contact of all, moved to where it fits the resting scan; None where no pad need be.

    ``skin`` is calibrated at rest and ``misfit`` is what that has left, over the noise.
    """
    contacts = skin.contact_resistance_ohm
    electrode = int(np.argmin(contacts))
    usual = float(np.median(contacts))
    if contacts[electrode] > VANISHED * usual or evidence.sensor.electrode_edge_m is not None:
        return None
    good = evidence.rest & np.isfinite(evidence.scan_v).all(axis=1)
    noise_v = evidence.noise_v / np.sqrt(good.sum())
    rest_v = evidence.scan_v[good].mean(axis=0)
    start = np.where(np.arange(len(contacts)) == electrode, usual, contacts)
    return _moved(skin, electrode, start, rest_v / noise_v, noise_v, WORTH * misfit**2)


def _moved(
    skin: Skin, electrode: int, contact_ohm: Array, rest: Array, noise_v: float, most: float
) -> ElectrodeDisplacement | None:
    """Gauss-Newton in the logarithms of contact and sheet resistances and the pad's place, on a new mesh every time.

    ``rest`` (P,) the scan over its noise; a mean square misfit of more than ``most`` is none that a place explains.
    """
    zero, count, usual_ohm = skin.piezo.zero_ohm_sq, len(contact_ohm), contact_ohm[electrode]
    shift_m = np.zeros(2)
    unlikely = np.zeros(count + 3)
    unlikely[electrode] = 1 / LIKELY
    for _ in range(ROUNDS):
        effect = ElectrodeDisplacement(electrode, *shift_m.tolist())
        try:
            scan_v, columns_v = _scan(skin, effect, zero, contact_ohm)
        except MeshError:
            return None
        wrong = rest - scan_v / noise_v
        wanted = np.append(wrong, np.log(usual_ohm / contact_ohm[electrode]) / LIKELY)
        step = np.linalg.lstsq(np.vstack([columns_v / noise_v, unlikely]), wanted, rcond=None)[0]
        if np.abs(step[count + 1 :]).max() < STILL_M:
            return effect if float(np.mean(wrong**2)) < most else None
        contact_ohm = contact_ohm * np.exp(np.clip(step[:count], -1.0, 1.0))
        zero *= float(np.exp(np.clip(step[count], -0.3, 0.3)))
        shift_m = shift_m + np.clip(step[count + 1 :], -LONGEST_M, LONGEST_M)
    return None


def _scan(skin: Skin, effect: ElectrodeDisplacement, zero_ohm_sq: float, contact_ohm: Array) -> tuple[Array, Array]:
    """The resting scan (P,) in volt with the pad moved, and its derivatives (P,L+3) by what ``_moved`` fits."""
    moved = Skin.build(
        effect.geometry(skin.sensor), skin.protocol, skin.piezo, contact_ohm, skin.support_n_per_m, (), "fine"
    )
    solution = moved.sheet.solve(moved.sheet.uniform(zero_ohm_sq), contact_ohm)
    slope = moved.protocol.whitened(solution.jacobian_contact_resistance().T).T
    scan = moved.protocol.whitened(solution.pair_resistance_ohm)
    pads = PadRims(moved.sheet).sensitivity(solution, moved.protocol)[:, effect.electrode]
    return scan, np.column_stack([slope * contact_ohm, scan - slope @ contact_ohm, pads])
