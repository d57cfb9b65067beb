"""Many channels off, or several side by side, are rather one fault than as many."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Claim, Estimate
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.judge.coincidence import FURTHER, chance_of, coincident, is_one_fault
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy


def claims_of(*effects: Effect) -> list[Claim]:
    return [Claim(effect, 0.99, 2.0, {}) for effect in effects]


def gains(*channels: int, gain: float = -0.01) -> list[Claim]:
    return claims_of(*(ChannelGain(channel=channel, gain=gain) for channel in channels))


def test_the_chance_of_lying_together_is_that_of_all_draws() -> None:
    channels, number = 9, 3
    draws = [np.array(draw) for draw in combinations(range(channels), number)]

    def within(draw: np.ndarray) -> int:
        return min(int(np.ptp((draw - turn) % channels)) + 1 for turn in range(channels))

    together = np.mean([within(draw) <= 4 for draw in draws])
    assert chance_of((8, 0, 2), channels, one_way=False) == pytest.approx(FURTHER * together)
    assert chance_of((8, 0, 2), channels, one_way=True) == pytest.approx(FURTHER * together / 4)
    assert chance_of((0, 3, 6), channels, one_way=False) == pytest.approx(FURTHER)
    assert chance_of((0, 4), channels, one_way=False) == pytest.approx(1.0)
    assert chance_of((3,), channels, one_way=True) == 1.0


def test_one_channel_and_two_far_apart_are_as_sure_as_before() -> None:
    assert coincident(gains(3), 24, DEFAULT) == gains(3)
    apart = claims_of(ChannelGain(2, gain=0.01), ChannelGain(14, gain=-0.02))
    assert [c.confidence for c in coincident(apart, 24, DEFAULT)] == pytest.approx([0.99, 0.99], abs=1e-3)


@pytest.mark.parametrize("confidence", [0.99, 0.4])
def test_many_far_apart_are_rather_one_fault_however_sure(confidence: float) -> None:
    effects = [ChannelGain(channel, gain=0.01 * (-1) ** channel) for channel in (0, 5, 10, 15, 20)]
    scattered = [replace(claim, confidence=confidence) for claim in claims_of(*effects)]
    found = coincident(scattered, 24, DEFAULT)
    assert found[0].confidence < 0.2
    assert is_one_fault(found, 24, DEFAULT)


def test_what_is_hardly_named_beside_one_does_not_count() -> None:
    claims = [*gains(7), *(replace(claim, confidence=0.06) for claim in gains(1, 12, 15, 20))]
    assert coincident(claims, 24, DEFAULT) == claims
    assert not is_one_fault(claims, 24, DEFAULT)


def test_offsets_go_one_way_by_themselves() -> None:
    offset = Estimate(0.01, 0.0099, 0.0101, "V")

    def claim(channel: int, gain: float) -> Claim:
        known = {"gain": Estimate(gain, gain - 1e-5, gain + 1e-5, "1"), "offset_v": offset}
        return Claim(ChannelGain(channel, gain=gain, offset_v=0.01), 0.99, 2.0, known)

    turning = coincident([claim(k, (-1) ** k * 1e-6) for k in range(3)], 24, DEFAULT)
    assert turning[0].confidence == coincident(gains(0, 1, 2), 24, DEFAULT)[0].confidence


def test_the_more_channels_lie_side_by_side_the_less_sure_they_are() -> None:
    sure = [coincident(gains(*range(number)), 24, DEFAULT)[0].confidence for number in (1, 2, 3, 4, 5)]
    assert sure == sorted(sure, reverse=True)
    assert sure[1] > 0.75
    assert sure[2] < DEFAULT.doubted_share
    assert sure[4] == DEFAULT.least_confidence


def test_what_else_is_named_is_as_sure_as_before() -> None:
    claims = [*claims_of(SheetAnisotropy(stretch_x=0.1)), *gains(0, 1, 2, 3)]
    assert coincident(claims, 24, DEFAULT)[0] == claims[0]


@pytest.mark.parametrize("channels", [16, 24, 32, 64])
def test_it_is_one_fault_where_that_is_likelier(channels: int) -> None:
    for number, expected in ((1, False), (2, False), (4, True)):
        assert is_one_fault(coincident(gains(*range(number)), channels, DEFAULT), channels, DEFAULT) is expected
