"""Where a press that moves is while it is scanned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor, rectangle_m
from ertskin.physics.skin import moments_of

SCAN_S = 0.4
MOMENTS_S = np.linspace(0.0, SCAN_S, 5)
STEP_M = 5e-4


@pytest.fixture
def history() -> History:
    """A frame at rest, two steps in, a hold, one step out."""
    depth_m = STEP_M * np.array([np.nan, 1, 2, 2, 1])[:, None]
    phase = np.array([Phase.REST, Phase.LOADING, Phase.LOADING, Phase.HOLD, Phase.UNLOADING], dtype=np.uint8)
    place = np.where(np.isfinite(depth_m)[..., None], 0.01, np.nan) * np.ones(2)
    nowhere = np.full((5, 1), np.nan)
    return History(np.arange(5.0), np.zeros(5, dtype=np.int64), phase, place, depth_m, nowhere)


def test_it_goes_on_at_constant_speed_and_stops_at_the_deepest_command(history: History) -> None:
    depth_m = ScanSkew(speed_m_per_s=1e-3).depth_m(history, MOMENTS_S)[..., 0]
    np.testing.assert_allclose(depth_m[1], STEP_M + 1e-3 * MOMENTS_S)
    np.testing.assert_allclose(depth_m[2], 2 * STEP_M)
    np.testing.assert_allclose(depth_m[3], 2 * STEP_M)
    np.testing.assert_allclose(depth_m[4], STEP_M - 1e-3 * MOMENTS_S)
    assert np.isnan(depth_m[0]).all()


def test_it_overshoots_where_it_may_but_never_leaves_the_surface(history: History) -> None:
    depth_m = ScanSkew(speed_m_per_s=5e-3, overshoots=True).depth_m(history, MOMENTS_S)[..., 0]
    np.testing.assert_allclose(depth_m[2], 2 * STEP_M + 5e-3 * MOMENTS_S)
    assert depth_m[4].min() == 0.0


@pytest.mark.parametrize("ease", [0.3, 1.0])
def test_easing_keeps_the_way_and_starts_and_ends_more_slowly(ease: float, history: History) -> None:
    moments_s = np.linspace(0.0, SCAN_S, 401)
    uneased, eased = (ScanSkew(1e-3, 0.5 * SCAN_S, e).depth_m(history, moments_s)[1, :, 0] for e in (0.0, ease))
    np.testing.assert_allclose(eased[[0, 200, 400]], uneased[[0, 200, 400]])
    speed = np.diff(eased) / np.diff(moments_s)
    assert speed[0] == pytest.approx((1 - ease) * 1e-3, abs=1e-5)
    assert speed[200] == pytest.approx((1 + 0.5 * ease) * 1e-3, rel=1e-3)


def test_straight_readings_are_a_mixture_of_those_at_a_scans_two_ends() -> None:
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4, injection_offset_s=np.linspace(0.0, SCAN_S, 15))
    moments_s, weights = moments_of(ScanSkew(speed_m_per_s=1e-3, straight=True), scan)
    share = np.linspace(0.0, 1.0, 15)
    np.testing.assert_array_equal(moments_s, [0.0, SCAN_S])
    np.testing.assert_allclose(weights, np.stack([1 - share, share], axis=1), atol=1e-12)
    # A skin's own run through every moment that is solved, the ends among them.
    moments_s, weights = moments_of(ScanSkew(speed_m_per_s=1e-3), scan)
    np.testing.assert_allclose(weights @ moments_s**3, (SCAN_S * share) ** 3)
    np.testing.assert_array_equal(moments_s[[0, -1]], [0.0, SCAN_S])


@pytest.mark.parametrize(("ease", "free"), [(0.0, ("at_s",)), (0.5, ("at_s", "ease"))])
def test_a_fit_may_take_readings_for_straight_which_easing_does_nothing_to(ease: float, free: tuple[str, ...]) -> None:
    skew = ScanSkew(speed_m_per_s=1e-3, ease=ease)
    straight = replace(skew, straight=True, ease=0.0)
    assert (straight, ("at_s",)) in [(start.effect, start.free) for start in skew.freer(free)]
    (overshooting,) = straight.freer(("at_s",))
    assert (overshooting.effect, overshooting.free) == (replace(straight, overshoots=True), ("at_s",))
    assert overshooting.effect.freer(overshooting.free) == ()


@pytest.mark.parametrize(("offset_s", "starts"), [(None, 0), (np.full(28, 1.5), 0), (0.01 * np.arange(28.0), 3)])
def test_it_is_looked_for_only_where_injections_are_known_to_follow_one_another(offset_s, starts: int) -> None:
    protocol = Protocol.against_sink(electrode_pairs(8), 8, 1e-4, injection_offset_s=offset_s)
    assert len(ScanSkew.reading_starts(Sensor(rectangle_m((0.1, 0.1))), protocol)) == starts
    assert protocol.timed == (starts > 0)


def test_by_steps_it_makes_a_part_of_every_step_and_sets_out_from_where_it_turns() -> None:
    depth_m = np.array([np.nan, 2e-4, 8e-4, 8e-4, 8e-4, 2e-4, np.nan])[:, None]
    phase = np.array([0, 1, 1, 2, 2, 3, 0], dtype=np.uint8)
    place = np.where(np.isfinite(depth_m)[..., None], 0.01, np.nan) * np.ones(2)
    history = History(np.arange(7.0), np.zeros(7, dtype=np.int64), phase, place, depth_m, np.full((7, 1), np.nan))
    # From one frame of a press to the next it goes 0.6 mm deeper, of which it makes a quarter in the scan.
    skew = ScanSkew(speed_m_per_s=0.25 * history.step_m / SCAN_S, by_steps=True)
    way_m = (skew.depth_m(history, MOMENTS_S) - depth_m[:, None, :])[1:6, -1, 0]
    np.testing.assert_allclose(way_m, [0.25 * 6e-4, 0.0, 0.0, -0.25 * 6e-4, -0.25 * 2e-4], atol=1e-12)
    arriving = replace(skew, at_s=SCAN_S)
    way_m = (arriving.depth_m(history, MOMENTS_S) - depth_m[:, None, :])[1:6, 0, 0]
    np.testing.assert_allclose(way_m, [-0.25 * 2e-4, -0.25 * 6e-4, 0.0, 0.0, 0.25 * 6e-4], atol=1e-12)


def test_by_steps_a_press_that_is_only_held_stays_and_rounding_of_its_depth_is_no_step() -> None:
    depth_m = np.array([np.nan, 1e-3, 1e-3 * (1 + 2e-16), np.nan, 5e-4, 1e-3, np.nan])[:, None]
    phase, press = np.array([0, 2, 2, 0, 1, 1, 0], dtype=np.uint8), np.array([0, 0, 0, 1, 1, 1, 2])
    place = np.where(np.isfinite(depth_m)[..., None], 0.01, np.nan) * np.ones(2)
    history = History(np.arange(7.0), press, phase, place, depth_m, np.full((7, 1), np.nan))
    moved_m = ScanSkew(speed_m_per_s=0.2 * 5e-4 / SCAN_S, by_steps=True).depth_m(history, MOMENTS_S)[:, -1, 0]
    np.testing.assert_allclose(moved_m[[1, 2, 4]], [1e-3, 1e-3, 6e-4], rtol=1e-9)


@pytest.mark.parametrize("bend", [-0.8, 0.5])
def test_a_bent_course_comes_to_the_same_ends_at_another_speed(bend: float, history: History) -> None:
    moments_s = np.linspace(0.0, SCAN_S, 401)
    even, bent = (ScanSkew(1e-3, bend=b).depth_m(history, moments_s)[1, :, 0] for b in (0.0, bend))
    np.testing.assert_allclose(bent[[0, -1]], even[[0, -1]])
    speed = np.diff(bent) / np.diff(moments_s)
    assert speed[0] == pytest.approx((1 - bend) * 1e-3, rel=0.02, abs=1e-5)
    assert speed[-1] == pytest.approx((1 + bend) * 1e-3, rel=0.02, abs=1e-5)
