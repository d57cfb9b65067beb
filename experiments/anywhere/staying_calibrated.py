"""A test recording whose skin drifts by known amounts: what zeroing alone and following make of it.

    python staying_calibrated.py NETWORK TEST.h5 CALIBRATION.yaml [SEED]

Rest readings are solved anew with the contacts and the sheet as they have become; what presses change scales with the
sheet. A contact doubled moves the response to a press by a thousandth, which is left out. Contacts are searched for as
live: without looking for those that fit poorly anew, which here would be most.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration import Calibration, load_calibration
from ertskin.data.touches import Touches, followed_touches, touches_of
from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.evaluation.novelty import novelty_of
from ertskin.hardware.recording import Recording, read_recording
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.monitor import SkinMonitor
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.conduction.sheet import SheetModel

Array = NDArray[np.float64]

HOUR_S = 3600.0
WARMED = -0.06
"""What ten kelvins do to a fabric of -0.6 % each, over the recording."""
WANDERED = 0.10
"""Standard deviation of a contact's random walk over an hour."""
DRIFTS = {"none": (0.0, 0.0), "both": (1.0, 1.0), "sheet": (1.0, 0.0), "contacts": (0.0, 1.0)}
COLUMNS = ("count_rate", "location_error_mm", "force_error_n")


def drifted(recording: Recording, calibration: Calibration, warmed: float, wandered: float, seed: int) -> Recording:
    """The recording on a skin whose sheet has changed by ``warmed`` in the end and whose contacts wander."""
    frames, protocol = recording.frames, recording.protocol
    assert frames is not None
    assert protocol is not None
    assert calibration.contact_resistance_ohm is not None
    rng, time_s = np.random.default_rng(seed), frames.history.time_s
    steps = np.sqrt(np.diff(time_s, prepend=time_s[0]) / HOUR_S)[:, None]
    contact = np.exp(wandered * np.cumsum(steps * rng.standard_normal((len(time_s), protocol.electrodes)), axis=0))
    sheet = 1.0 + warmed * (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    model = SheetModel(calibration.known_sensor, "fast")
    ohm_sq, contact_ohm = calibration.known_sensor.sheet_resistance_ohm_sq, calibration.contact_resistance_ohm
    base = model.solve(model.uniform(ohm_sq), contact_ohm)
    rest_v = frames.voltage_v[frames.history.phase == 0].mean(axis=0)
    voltage = np.empty(frames.voltage_v.shape, dtype=np.float32)
    for k, one in enumerate(frames.voltage_v):
        # A sheet f times as resistive with contacts z is f times the old one with contacts z / f.
        pairs = sheet[k] * model.solve_contacts(contact_ohm * contact[k] / sheet[k], base).pair_resistance_ohm
        moved = protocol.readings(pairs - base.pair_resistance_ohm)
        pressed = frames.history.phase[k] != 0
        voltage[k] = one + moved + (sheet[k] - 1.0) * (one - rest_v) * pressed
    return replace(recording, frames=replace(frames, voltage_v=voltage))


def scores(network: Reconstruction, touches: Touches) -> dict[str, float]:
    """The contacts' metrics, and the share of frames beyond the limit of novelty."""
    estimate = network.estimate_coordinates(touches.change_v)
    assert estimate.contact_m is not None
    assert estimate.contact_force_n is not None
    true_m = np.where(touches.history.touched[..., None], touches.history.contact_m, np.nan)
    true_n = np.where(touches.history.touched, touches.history.force_n, np.nan)
    outcome = ContactOutcome(
        true_m, true_n, estimate.contact_m, estimate.contact_force_n, network.network.answers_m, estimate.covariance
    )
    found = {name: score.value for name, score in contact_scores(outcome).items() if name[:-2] in COLUMNS}
    novelty = novelty_of(network, touches, estimate)
    assert novelty is not None
    return found | {"novel": float(np.mean(novelty > 1.0))}


def main() -> None:
    """Print a line of JSON for each drift and way of counting."""
    path, test, calibrated, *seeds = sys.argv[1:]
    network, recording = Reconstruction.load(Path(path)), read_recording(Path(test))
    calibration, monitor = load_calibration(Path(calibrated)), network.monitor
    assert isinstance(monitor, SkinMonitor), "this network does not know its resting skin: train it again"
    assert isinstance(network.network, ContactsNetwork), "not a network of contacts anywhere"
    network.network.exchanges = 0
    for name, (sheet, contacts) in DRIFTS.items():
        seen = drifted(recording, calibration, sheet * WARMED, contacts * WANDERED, int(seeds[0]) if seeds else 0)
        followed, course = followed_touches(seen, monitor.resting)
        for way, touches in (("zeroing alone", touches_of(seen)), ("followed", followed)):
            line = {"drift": name, "way": way} | {k: round(v, 3) for k, v in scores(network, touches).items()}
            line |= {"sheet": round(course.sheet, 5), "contact": round(course.contact, 3)} if way == "followed" else {}
            print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
