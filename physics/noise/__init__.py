"""Noise models: what a reading carries beyond the skin's own answer."""

from ertskin.physics.noise.gaussian import GaussianNoise
from ertskin.physics.noise.measured import MeasuredNoise
from ertskin.physics.noise.model import Noise
from ertskin.physics.noise.nothing import NoNoise
from ertskin.physics.noise.white import WhiteNoise

__all__ = ["GaussianNoise", "MeasuredNoise", "NoNoise", "Noise", "WhiteNoise"]
