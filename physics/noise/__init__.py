"""Noise models: what a reading carries beyond the skin's own answer."""

from physics.noise.gaussian import GaussianNoise
from physics.noise.measured import MeasuredNoise
from physics.noise.model import Noise
from physics.noise.nothing import NoNoise
from physics.noise.white import WhiteNoise

__all__ = ["GaussianNoise", "MeasuredNoise", "NoNoise", "Noise", "WhiteNoise"]
