"""Where to press next: the skin as a recording shows it so far, and the press that would tell most about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration.fit import fit_recording
from ertskin.calibration.rest_slopes import rest_slopes_v
from ertskin.calibration.result import Calibration
from ertskin.data.anywhere import largest_force_n, pressed, touch_model
from ertskin.data.informative_press import Accuracy, PressDesign, middles_m, most_telling
from ertskin.data.skin_forward import SkinForward
from ertskin.data.touches import Touches, touches_of
from ertskin.diagnosis.design.next_press import places_m
from ertskin.errors import UserError
from ertskin.hardware.recording import Recording
from ertskin.physics.noise import MeasuredNoise, Noise, WhiteNoise
from ertskin.physics.sensor import Sensor
from ertskin.physics.touch.interplay import Interplay
from ertskin.physics.touch.table import ResponseTable, TouchGrid

Array = NDArray[np.float64]

SPACING_M, FORCES = 0.005, 6
"""Of the table that errors are predicted with: coarser than the one contacts are found with, for seconds count. With
10 mm and 4 forces its splines' errors passed for the skin's: 3.1 N were predicted for six presses of `rig_a` that left
0.2."""
COMPONENTS = 96
RESOLUTION = "fast"


@dataclass(frozen=True)
class Choice:
    """``now``: the accuracy to be expected of the presses so far; ``place_m`` of the next press, ``then`` after it."""

    now: Accuracy
    place_m: tuple[float, float]
    then: Accuracy


def places_to_press_m(sensor: Sensor) -> Array:
    """(n,2) the taxels and the middles between them; the middles of a lattice where there are none."""
    return places_m(sensor) if len(sensor.taxel_m) > 1 else middles_m(*sensor.extent_m)


def first_place_m(place_m: Array, sensor: Sensor) -> tuple[float, float]:
    """Of the places (n,2) the one in the middle: nothing is known yet."""
    x, y = place_m[int(np.linalg.norm(place_m - sensor.extent_m.mean(axis=0), axis=1).argmin())]
    return float(x), float(y)


def chosen_press(recording: Recording, name: str, place_m: Array, wanted: Accuracy) -> Choice:
    """What the presses of ``recording`` tell, and which of the places (n,2) would tell most, pressed as hard.

    The calibration is made anew from the presses so far. Raises ``UserError`` where they tell of no response: no
    protocol, no specimen, no force.
    """
    design, force_n = design_of(recording, name)
    best, then = most_telling(design, place_m, force_n, wanted)
    return Choice(design.accuracy(), (float(place_m[best, 0]), float(place_m[best, 1])), then)


def design_of(recording: Recording, name: str) -> tuple[PressDesign, Array]:
    """The design that goes on from ``recording``'s presses of one contact, and the forces (F,) of its last press."""
    touches = touches_of(recording)
    real = pressed(touches)
    if not len(real):
        raise UserError(f"{name}: has no press with a force to choose the next one from")
    calibration, _ = fit_recording(recording, name)
    forward = SkinForward(calibration, touches.protocol, {}, RESOLUTION)
    grid = TouchGrid.over(calibration.known_sensor.extent_m, SPACING_M, FORCES, largest_force_n(touches))
    change_ohm = forward.change_ohm(*grid.presses())
    no_cells = np.zeros((len(change_ohm), 1))
    table = ResponseTable.through(grid, change_ohm, no_cells, _no_interplay(touches.protocol.electrodes))
    if calibration.noise_v is None:
        raise UserError(f"{name}: its noise is not known, for it takes two rest frames")
    noise = _noise(touches, calibration, calibration.noise_v)
    model = touch_model(touches.protocol, table, noise, None, correct=False).strongest(COMPONENTS)
    history = real.history
    force_n = history.force_n[:, 0]
    seen = real.change_v @ model.matrix
    design = PressDesign(model.table, history.contact_m[:, 0], force_n, history.press, seen, float(force_n.max()))
    return design, force_n[history.press == history.press.max()]


def _noise(touches: Touches, calibration: Calibration, noise_v: float) -> Noise:
    """White where the first presses have too few rest frames to tell how contacts and sheet wander."""
    if len(touches.rest_v) < 3:
        return WhiteNoise(touches.protocol, noise_v)
    slope_v = rest_slopes_v(touches.protocol, calibration, RESOLUTION)
    return MeasuredNoise.from_rest(touches.protocol, touches.rest_v, slope_v, touches.rest_zero)


def _no_interplay(electrodes: int) -> Interplay:
    """One contact alone needs none."""
    return Interplay(np.zeros((1, 2)), np.ones(1), np.zeros((1, 2, electrodes)), np.zeros((1, 2, 1, 2)))
