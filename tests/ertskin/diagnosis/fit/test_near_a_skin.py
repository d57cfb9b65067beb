"""What a small change of a skin does to its scans, through an instrument that isn't linear, to first order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import recorded

from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.effect import AcquisitionEffect
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis


@pytest.mark.parametrize(
    ("instrument", "off"),
    [(ChannelGain(channel=2, gain=0.1), 1e-12), (AdcSaturation(compression=0.05, sharpness=2.0), 0.02)],
    ids=["linear", "a bend"],
)
def test_a_small_change_is_seen_through_the_instrument(instrument: AcquisitionEffect, off: float) -> None:
    problem = recorded()
    if isinstance(instrument, AdcSaturation):
        instrument = instrument.scaled_to(problem.acquisition.largest_v)
    skin = replace(problem.linear.skin, effects=(instrument, PiezoHysteresis(width=0.1)))
    moved = replace(skin, effects=(instrument, PiezoHysteresis(width=0.101)))
    scan = problem.scan_residual(skin)
    seen, found = (blocks[0] - scan for blocks in (problem._blocks(moved), problem._near(skin, scan)(moved)))
    unread = problem.linear.scans(replace(moved, effects=moved.effects[1:])) - problem.linear.scans(
        replace(skin, effects=skin.effects[1:])
    )
    size = np.linalg.norm(seen)
    assert np.linalg.norm(seen - found) < off * size
    # The instrument itself does more to it than that.
    assert np.linalg.norm(seen + unread / problem.evidence.noise_v) > off * size
