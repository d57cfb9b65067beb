"""From a recording to the numbers of the simulator (paper III), kept as a readable file."""

from ertskin.calibration.result import Calibration
from ertskin.calibration.store import load_calibration, save_calibration

__all__ = ["Calibration", "load_calibration", "save_calibration"]
