"""From a recording on a soft ERT skin to a calibrated network, and to the physics its simulator left out.

What a script needs is here, and imported when it is first asked for, so that ``import ertskin`` costs nothing:

>>> import ertskin
>>> recording = ertskin.read_recording("mine.h5")          # doctest: +SKIP
>>> calibration = ertskin.calibrate(recording)             # doctest: +SKIP
>>> network = ertskin.load_network("runs/train/JOB")       # doctest: +SKIP
>>> touches = network.predict(recording.frames.voltage_v)  # doctest: +SKIP

Everything below ``ertskin.`` that isn't listed in ``__all__`` may change from version to version.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from ertskin.calibration.result import Calibration
    from ertskin.calibration.store import load_calibration, save_calibration
    from ertskin.diagnosis.contract.claims import Diagnosis
    from ertskin.diagnosis.criteria import Criteria
    from ertskin.errors import UserError
    from ertskin.hardware.description import DescriptionError, protocol_of, sensor_of
    from ertskin.hardware.measurement import Coupon, Frames, Recording, RecordingError, RigidBlock, Specimen
    from ertskin.hardware.recording import read_recording, write_recording
    from ertskin.library.calibrating import calibrate
    from ertskin.library.diagnosing import diagnose
    from ertskin.library.networks import TrainedNetwork, load_network
    from ertskin.library.simulating import simulate
    from ertskin.models.estimate import Estimate
    from ertskin.physics.history import History, Phase
    from ertskin.physics.protocol import Protocol
    from ertskin.physics.sensor import Layer, Sensor

_HOME = {
    "Calibration": "ertskin.calibration.result",
    "Coupon": "ertskin.hardware.measurement",
    "Criteria": "ertskin.diagnosis.criteria",
    "DescriptionError": "ertskin.hardware.description",
    "Diagnosis": "ertskin.diagnosis.contract.claims",
    "Estimate": "ertskin.models.estimate",
    "Frames": "ertskin.hardware.measurement",
    "History": "ertskin.physics.history",
    "Layer": "ertskin.physics.sensor",
    "Phase": "ertskin.physics.history",
    "Protocol": "ertskin.physics.protocol",
    "Recording": "ertskin.hardware.measurement",
    "RecordingError": "ertskin.hardware.measurement",
    "RigidBlock": "ertskin.hardware.measurement",
    "Sensor": "ertskin.physics.sensor",
    "Specimen": "ertskin.hardware.measurement",
    "TrainedNetwork": "ertskin.library.networks",
    "UserError": "ertskin.errors",
    "calibrate": "ertskin.library.calibrating",
    "diagnose": "ertskin.library.diagnosing",
    "load_calibration": "ertskin.calibration.store",
    "load_network": "ertskin.library.networks",
    "protocol_of": "ertskin.hardware.description",
    "read_recording": "ertskin.hardware.recording",
    "save_calibration": "ertskin.calibration.store",
    "sensor_of": "ertskin.hardware.description",
    "simulate": "ertskin.library.simulating",
    "write_recording": "ertskin.hardware.recording",
}
"""The module that defines each public name."""

__all__ = [
    "Calibration",
    "Coupon",
    "Criteria",
    "DescriptionError",
    "Diagnosis",
    "Estimate",
    "Frames",
    "History",
    "Layer",
    "Phase",
    "Protocol",
    "Recording",
    "RecordingError",
    "RigidBlock",
    "Sensor",
    "Specimen",
    "TrainedNetwork",
    "UserError",
    "__version__",
    "calibrate",
    "diagnose",
    "load_calibration",
    "load_network",
    "protocol_of",
    "read_recording",
    "save_calibration",
    "sensor_of",
    "simulate",
    "write_recording",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
