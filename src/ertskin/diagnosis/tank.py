"""A tank or sheet without mechanics: which readings no resistor network explains, and where the sheet changed.

Frame 0 is the empty tank: one contact resistance per electrode and the sheet's resistance are fitted to it; the
standing misfit is searched for the electrode whose readings are wrong. Later frames are imaged against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.claims import Claim, Diagnosis, Estimate, HeldOut
from ertskin.diagnosis.diagnose import Findings
from hardware.recording import Recording
from physics.conduction.sheet import SheetModel, Solution
from physics.effects.channel_gain import ChannelGain
from physics.protocol import Protocol

Array = NDArray[np.float64]

ROUNDS = 40
RESOLUTION = "fast"


@dataclass(frozen=True, eq=False)
class Background:
    """The empty tank: solution, whitened misfit (P,) and readings' misfit (K,M) in volt."""

    model: SheetModel
    solution: Solution
    resistance_ohm_sq: float
    contact_ohm: Array
    misfit_v: Array
    rms_v: float


def fit_background(recording: Recording, frame: int = 0, weight: Array | None = None) -> Background:
    """Contact resistances and the water's resistance of one frame, by Gauss-Newton in their logarithms.

    ``weight`` (K,M) leaves readings out where it is 0.
    """
    assert recording.sensor is not None
    assert recording.protocol is not None
    assert recording.frames is not None
    protocol = recording.protocol
    reading = np.asarray(recording.frames.voltage_v[frame], dtype=float)
    keep = np.isfinite(reading) if weight is None else np.isfinite(reading) & (weight > 0)
    model = SheetModel(recording.sensor, RESOLUTION)
    design = protocol.design.reshape(*protocol.shape, -1)
    contact = np.full(protocol.electrodes, recording.sensor.contact_resistance_guess_ohm)
    sheet = recording.sensor.sheet_resistance_ohm_sq
    unit = model.solve(model.uniform(sheet), contact)
    predicted = design @ unit.pair_resistance_ohm
    scale = float((predicted[keep] @ reading[keep]) / (predicted[keep] @ predicted[keep]))
    sheet, contact = sheet * scale, np.maximum(contact * min(scale, 1.0), 1e-6)
    for _ in range(ROUNDS):
        solution = model.solve(model.uniform(sheet), contact)
        slope = solution.jacobian_contact_resistance()
        pairs = solution.pair_resistance_ohm
        columns = np.column_stack([slope * contact, pairs - slope @ contact])
        full = (design @ columns)[keep]
        wrong = (reading - design @ pairs)[keep]
        step = np.linalg.lstsq(full, wrong, rcond=1e-9)[0]
        contact = np.clip(contact * np.exp(np.clip(step[:-1], -1.0, 1.0)), 1e-6 * sheet, 1e3 * sheet)
        sheet = sheet * float(np.exp(np.clip(step[-1], -0.3, 0.3)))
        if np.abs(step).max() < 1e-6:
            break
    solution = model.solve(model.uniform(sheet), contact)
    misfit = np.where(np.isfinite(reading), reading - design @ solution.pair_resistance_ohm, 0.0)
    return Background(model, solution, sheet, contact, misfit, float(np.sqrt((misfit[keep] ** 2).mean())))


def electrode_errors(background: Background, protocol: Protocol) -> Array:
    """(L,) share of the misfit's energy that readings touching each electrode lose when that electrode is left out."""
    energy = background.misfit_v**2
    touching = (
        np.abs(protocol.measurement).max(axis=1) > 0 if protocol.measurement.ndim == 2 else protocol.measurement != 0
    )
    share = np.empty(protocol.electrodes)
    for electrode in range(protocol.electrodes):
        mine = touching[..., electrode] | (protocol.injection_current_a[:, electrode] != 0)[:, None]
        share[electrode] = energy[mine].sum() / max(energy.sum(), 1e-300) / max(mine.mean(), 1e-9)
    return share


def diagnose_tank(recording: Recording, name: str) -> Findings:
    """Name the electrode with a standing error in the empty tank, if one stands out."""
    assert recording.protocol is not None
    assert recording.sensor is not None
    assert recording.frames is not None
    nothing = HeldOut("none", None, None, None, None)
    if not np.isfinite(recording.frames.voltage_v[0]).all():
        return Findings(
            Diagnosis(name, "cannot_tell", nothing, reason="the first frame has readings that are no numbers")
        )
    protocol = recording.protocol
    whole = fit_background(recording)
    noise = reciprocity_noise_v(recording)
    found = []
    for electrode in range(protocol.electrodes):
        touching = (protocol.measurement[..., electrode] != 0) | (protocol.injection_current_a[:, electrode] != 0)[
            :, None
        ]
        rest = whole.misfit_v[~touching]
        found.append(float(np.sqrt((rest**2).mean())))
    best = int(np.argmin(found))
    others = np.delete(found, best)
    stands_out = (np.median(others) - found[best]) / max(
        1.4826 * float(np.median(np.abs(others - np.median(others)))), 1e-12
    )
    ratio = whole.rms_v / noise
    claims: tuple[Claim, ...] = ()
    electrodes: tuple[int, ...] = ()
    if stands_out < 4:
        verdict = "unexplained" if ratio > 1.05 else "no_mismatch"
    else:
        gain = channel_gain(whole, protocol, best)
        effect = ChannelGain(best, gain=float(np.clip(gain, -0.49, 0.49)))
        confidence = float(min(0.9, 1 - 2 / stands_out))
        claims = (Claim(effect, confidence, whole.rms_v / found[best], {"gain": Estimate(gain, gain, gain, "1")}),)
        verdict, electrodes = "partly_explained", (best,)
    held = HeldOut(
        "readings that don't touch the electrode", noise, ratio, (found[best] if claims else whole.rms_v) / noise, None
    )
    return Findings(
        Diagnosis(
            name,
            verdict,
            held,
            stage="acquisition" if claims else None,
            electrodes=electrodes,
            depends_on=("electrode",) if claims else (),
            claims=claims,
            unexplained_ratio=held.ratio_after,
        )
    )


def channel_gain(background: Background, protocol: Protocol, electrode: int) -> float:
    """Relative error of the readings at an electrode, by regression of their misfit on what the model predicts."""
    design = protocol.design.reshape(*protocol.shape, -1)
    predicted = design @ background.solution.pair_resistance_ohm
    mine = protocol.measurement[..., electrode] != 0
    return float((predicted[mine] @ background.misfit_v[mine]) / (predicted[mine] @ predicted[mine]))


def reciprocity_noise_v(recording: Recording) -> float:
    """Rms in volt of what no resistor network explains of the first frame."""
    assert recording.protocol is not None
    assert recording.frames is not None
    protocol = recording.protocol
    reading = np.asarray(recording.frames.voltage_v[0], dtype=float).ravel()
    left = reading - protocol.design @ np.linalg.lstsq(protocol.design, reading, rcond=1e-9)[0]
    rank = int(np.linalg.matrix_rank(protocol.design))
    return float(np.sqrt((left**2).sum() / max(1, len(reading) - rank)))
