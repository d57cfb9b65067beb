"""What a recording says of its instrument: noise, bent converters, channels that are wrong as a whole."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.recording.evidence import (
    MOST_USUAL,
    _bent_at_top,
    _bent_from,
    _bent_level_v,
    _channels_restored,
    _compressed,
    _leftover,
    _leftover_noise_v,
    _noise_error,
    _noise_v,
    _presses_restored,
    _saturation,
    _scans,
    _usual_restored,
    leftover_freedom,
)
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.spikes import despiked

NOISE_V = 2e-3
FRAMES = 8


def readings(protocol: Protocol, seed: int) -> np.ndarray:
    """(T,K,M) noisy readings of a resistor network that changes a little from frame to frame."""
    rng = np.random.default_rng(seed)
    pairs = 3e4 * (1 + rng.random(protocol.electrodes * (protocol.electrodes - 1) // 2))
    clean = protocol.readings(pairs * (1 + 0.01 * rng.random((FRAMES, len(pairs)))))
    return clean + NOISE_V * rng.standard_normal(clean.shape)


def split(protocol: Protocol, voltage: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scans, fitted readings and spikes as the diagnosis sees them."""
    scan, spike = _channels_restored(protocol, voltage, *despiked(protocol, voltage))
    return scan, (scan @ protocol.orthonormal.T).reshape(voltage.shape), spike


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    return Protocol.against_sink(electrode_pairs(24), 24, 1e-4)


def test_a_systematic_error_is_no_noise(protocol: Protocol) -> None:
    voltage = readings(protocol, 1)
    voltage[..., 5] *= 1.02
    _, fitted, spike = split(protocol, voltage)
    leftover = np.where(spike, 0.0, voltage - fitted)
    assert np.sqrt((leftover**2).mean()) > 1.5 * NOISE_V
    assert _leftover_noise_v(leftover, spike, np.ones(FRAMES, dtype=bool)) == pytest.approx(NOISE_V, rel=0.05)


def test_a_channel_that_is_wrong_as_a_whole_is_no_spike(protocol: Protocol) -> None:
    voltage = readings(protocol, 2)
    voltage[..., 5] *= 1.05
    assert despiked(protocol, voltage)[1][..., 5].mean() > 0.05
    assert split(protocol, voltage)[2][..., 5].mean() == 0.0


def test_single_spikes_stay_spikes(protocol: Protocol) -> None:
    voltage = readings(protocol, 3)
    voltage[2, 100, 7] += 1.0
    spike = split(protocol, voltage)[2]
    assert spike[2, 100, 7]
    assert spike.sum() < 5


def test_a_reading_that_is_usually_off_as_far_as_a_spike_is_none(protocol: Protocol) -> None:
    voltage = readings(protocol, 12)
    voltage[:, 100, 7] += 6 * NOISE_V
    voltage[2, 50, 3] += 1.0
    _scan, fitted, spike = split(protocol, voltage)
    assert 0 < spike[:, 100, 7].sum() < FRAMES, "left out in some frames and not in others"
    _, kept = _usual_restored(protocol, voltage, fitted, spike, MOST_USUAL)
    assert not kept[:, 100, 7].any()
    assert kept[2, 50, 3]


@pytest.mark.parametrize("share", [0.6, 1.0])
def test_a_reading_that_is_plainly_wrong_stays_left_out(protocol: Protocol, share: float) -> None:
    voltage = np.concatenate([readings(protocol, 13)] * 2)
    wrong = np.arange(len(voltage)) < share * len(voltage)
    voltage[wrong, 100, 7] += 1.0
    clean, _ = despiked(protocol, np.concatenate([readings(protocol, 13)] * 2))
    scan, spike, _ = _scans(protocol, voltage, np.ones(len(voltage), dtype=bool), False)
    assert spike[wrong, 100, 7].all()
    assert np.abs(scan - clean).max() < 5 * NOISE_V


@pytest.fixture(scope="module")
def undriven() -> Protocol:
    """Neighbours drive and are read, none of them a driven electrode's: every reading has one twin."""
    pairs = np.stack([np.arange(16), np.roll(np.arange(16), -1)], axis=1)
    current_a = np.eye(16)[pairs[:, 0]] - np.eye(16)[pairs[:, 1]]
    driven = np.array([[bool({k, m} & set(pair)) for pair in pairs] for k, m in pairs])
    scan = Protocol.differences(1e-3 * current_a, pairs)
    return Protocol(scan.injection_current_a, scan.measurement, measured=~driven)


@pytest.mark.parametrize("wrong", ["offset", "gain"])
def test_of_two_readings_that_disagree_neither_is_a_spike_but_a_jump_of_one_is(undriven: Protocol, wrong: str) -> None:
    voltage = np.concatenate([readings(undriven, 14)] * 2)
    voltage[::4] *= 0.8  # as under presses
    size = voltage[0, 12, 7]
    voltage[:, 12, 7] += 20 * NOISE_V if wrong == "offset" else 100 * NOISE_V * voltage[:, 12, 7] / size
    straight = np.where(undriven.taken, voltage, 0.0).reshape(len(voltage), -1) @ undriven.orthonormal
    voltage[3, 2, 9] += 1.0
    left_out = despiked(undriven, voltage)[1]
    assert left_out[:, 12, 7].any() or left_out[:, 7, 12].any()
    scan, spike, _ = _scans(undriven, voltage, np.arange(len(voltage)) % 4 != 0, False)
    lost = spike & undriven.taken
    assert np.argwhere(lost).tolist() in ([[3, 2, 9]], [[3, 9, 2]])
    others = np.arange(len(voltage)) != 3
    np.testing.assert_allclose(scan[others], straight[others], atol=1e-9)


def test_what_is_left_of_a_reading_whose_only_twin_was_left_out_says_nothing(undriven: Protocol) -> None:
    voltage = readings(undriven, 15)
    spike = despiked(undriven, voltage)[1]
    spike[:, 12, 7] = True
    fitted = np.where(spike, 0.0, voltage)
    fitted[:, 12, 7] = voltage[:, 7, 12]
    fitted = (fitted.reshape(FRAMES, -1) @ undriven.orthonormal @ undriven.orthonormal.T).reshape(voltage.shape)
    assert (voltage - fitted)[:, 7, 12].any()
    left = _leftover(voltage, fitted, spike)
    assert not left[:, [12, 7], [7, 12]].any()
    assert (left[:, 3, 9] != 0).all()


def test_a_converter_that_bends_is_seen_and_a_straight_one_is_not(protocol: Protocol) -> None:
    voltage = readings(protocol, 4)
    _, fitted, spike = split(protocol, voltage)
    assert not _bent_at_top(voltage, fitted, spike)
    knee = np.quantile(voltage, 0.9995)
    bent = np.where(voltage > knee, knee + 0.2 * (voltage - knee), voltage)
    _, fitted, spike = split(protocol, bent)
    assert _bent_at_top(bent, fitted, spike)


def test_a_limit_under_noise_is_where_readings_stop_not_the_largest_of_them(protocol: Protocol) -> None:
    rng = np.random.default_rng(5)
    pairs = 3e4 * (1 + rng.random(protocol.electrodes * (protocol.electrodes - 1) // 2))
    clean = np.repeat(protocol.readings(pairs[None]), FRAMES, axis=0)
    limit = float(np.quantile(clean, 0.9995))
    voltage = np.minimum(clean, limit) + NOISE_V * rng.standard_normal(clean.shape)
    _, fitted, spike = split(protocol, voltage)
    assert voltage.max() > limit + 2 * NOISE_V
    assert _bent_level_v(voltage, fitted, spike) == pytest.approx(limit, abs=NOISE_V)


def test_a_limit_that_the_source_of_every_injection_reaches_is_seen_under_noise() -> None:
    """A source stands at twice the potential of the others where contacts are most of what is read."""
    protocol = Protocol.against_sink(electrode_pairs(16), 16, 1e-4)
    rng = np.random.default_rng(7)
    pairs = 3e4 * (1 + 0.02 * rng.random(protocol.electrodes * (protocol.electrodes - 1) // 2))
    clean = np.repeat(protocol.readings(pairs[None]), FRAMES, axis=0)
    limit, noise_v = 0.55 * float(clean.max()), 30 * NOISE_V
    assert (clean[0] > limit).mean() > 0.05
    voltage = np.minimum(clean, limit) + noise_v * rng.standard_normal(clean.shape)
    _, fitted, spike = split(protocol, voltage)
    assert _bent_at_top(voltage, fitted, spike)
    assert _bent_level_v(voltage, fitted, spike) == pytest.approx(limit, abs=noise_v)
    straight = clean + noise_v * rng.standard_normal(clean.shape)
    _, fitted, spike = split(protocol, straight)
    assert not _bent_at_top(straight, fitted, spike)


def test_what_is_compressed_softly_is_neither_spike_nor_limit(protocol: Protocol) -> None:
    voltage, rest = readings(protocol, 4), np.arange(FRAMES) < 3
    largest = float(voltage.max())
    soft = largest / 0.3 * np.tanh(0.3 * voltage / largest)
    assert despiked(protocol, soft)[1].sum() > 100
    scan, spike, bent = _scans(protocol, soft, rest, saturated=False)
    assert not spike.any()
    assert not bent
    np.testing.assert_allclose(scan, soft.reshape(FRAMES, -1) @ protocol.orthonormal, atol=1e-9)


def test_a_spike_on_a_compressed_reading_stays_one(protocol: Protocol) -> None:
    voltage, rest = readings(protocol, 4), np.arange(FRAMES) < 3
    largest = float(voltage.max())
    soft = largest / 0.3 * np.tanh(0.3 * np.repeat(voltage, 5, axis=0) / largest)
    soft[20, 100, 7] -= 1.0
    _, spike, _ = _scans(protocol, soft, np.repeat(rest, 5), saturated=False)
    assert np.argwhere(spike).tolist() == [[20, 100, 7]]


def test_neither_a_limit_nor_a_channel_s_gain_is_a_compression(protocol: Protocol) -> None:
    voltage, rest = readings(protocol, 4), np.arange(FRAMES) < 3
    knee = float(np.quantile(voltage, 0.999))
    limited = np.minimum(voltage, knee + 0.5 * NOISE_V * np.random.default_rng(0).random(voltage.shape))
    low = voltage.copy()
    low[..., 5] *= 0.97
    for wrong in (voltage, limited, low):
        _, fitted, spike = split(protocol, wrong)
        assert not _compressed(wrong, fitted, spike, rest)


def test_two_readings_of_few_are_seen_to_bend_and_two_at_a_limit_not_to() -> None:
    frames, rng = 13, np.random.default_rng(1)
    fitted = np.linspace(0.2, 4.0, 40) + NOISE_V * rng.standard_normal((frames, 1, 40))
    spike = np.broadcast_to(np.arange(40) > 37, fitted.shape)
    soft = np.where(spike, 20.0 * np.tanh(fitted / 20.0), fitted)
    assert _compressed(soft, fitted, spike, np.ones(frames, dtype=bool))
    for _ in range(200):
        at_limit = np.where(spike, 3.88 + NOISE_V * rng.standard_normal(fitted.shape), fitted)
        assert not _compressed(at_limit, fitted, spike, np.ones(frames, dtype=bool))
        # A reciprocal pair: what they should differ by is noise.
        fitted[..., 38] = fitted[..., 39] + NOISE_V * rng.standard_normal((frames, 1))


def test_what_only_presses_show_is_no_spike(protocol: Protocol) -> None:
    voltage = readings(protocol, 3)
    rest = np.arange(FRAMES) < 3
    moving = np.linspace(0, 1, voltage.shape[1])[:, None] ** 4 * 60 * NOISE_V
    voltage[~rest] += moving
    scan, spike = despiked(protocol, voltage)
    assert spike[~rest].mean() > 2e-3
    assert not _presses_restored(protocol, voltage, scan, spike, rest)[1].any()
    anywhere = readings(protocol, 4)
    anywhere[np.random.default_rng(4).random(anywhere.shape) < 0.01] += 1.0
    scan, spike = despiked(protocol, anywhere)
    assert np.array_equal(_presses_restored(protocol, anywhere, scan, spike, rest)[1], spike)


def test_a_moving_press_is_no_spike_on_a_converter_that_bends_either(protocol: Protocol) -> None:
    voltage = readings(protocol, 3)
    rest = np.arange(FRAMES) < 3
    knee = float(np.quantile(voltage, 0.9995))
    moving = np.linspace(0, 1, voltage.shape[1])[:, None] ** 4 * 60 * NOISE_V
    voltage[~rest] += moving
    bent = np.where(voltage > knee, knee + 0.2 * (voltage - knee), voltage)
    scan, spike = despiked(protocol, bent)
    fitted = (scan @ protocol.orthonormal.T).reshape(bent.shape)
    from_v = _bent_from(fitted[rest], spike[rest])
    assert knee < from_v < knee + 20 * NOISE_V
    _, left_out = _presses_restored(protocol, np.where(fitted < from_v, bent, np.nan), scan, spike, rest)
    assert np.array_equal(left_out[~rest], fitted[~rest] >= from_v)


def test_what_a_press_takes_to_between_limit_and_rest_stays_left_out() -> None:
    # At rest nothing lies between the limit and the readings beyond it; pressed, they come down into the gap.
    protocol, rng = Protocol.against_sink(electrode_pairs(16), 16, 1e-4), np.random.default_rng(6)
    pairs = 3e4 * (1 + rng.random(protocol.electrodes * (protocol.electrodes - 1) // 2))
    pairs[[40, 70]] = 1.5 * pairs.max()
    rest = np.arange(FRAMES) < 5
    clean = protocol.readings(pairs[None]) * np.where(rest, 1.0, 0.97)[:, None, None]
    limit = 0.9 * float(clean.max())
    voltage = np.minimum(clean, limit) + NOISE_V * rng.standard_normal(clean.shape)
    scan, spike, bent = _scans(protocol, voltage, rest, saturated=False)
    assert bent
    assert (clean > limit)[~rest].any()
    assert spike[clean > limit].all()
    fitted = (scan @ protocol.orthonormal.T).reshape(clean.shape)
    assert np.abs(fitted - clean)[~rest].max() < 10 * NOISE_V


def test_readings_at_the_limit_stay_left_out_where_one_channel_has_them_all() -> None:
    """A contact that resists most takes its own electrode's channel, and no other, to the limit."""
    protocol, rng = Protocol.against_sink(electrode_pairs(16), 16, 1e-4), np.random.default_rng(8)
    contact = np.full(16, 1e4)
    contact[0] = 3e4
    source, sink = np.triu_indices(16, 1)
    pairs = contact[source] + contact[sink] + 5e3 * rng.random(len(source))
    clean = np.repeat(protocol.readings(pairs[None]), FRAMES, axis=0)
    limit = float(np.quantile(clean, 0.997))
    voltage = np.minimum(clean, limit) + NOISE_V * rng.standard_normal(clean.shape)
    beyond = clean > limit + 10 * NOISE_V
    assert np.flatnonzero(beyond.any(axis=(0, 1))).tolist() == [0]
    scan, spike, bent = _scans(protocol, voltage, np.arange(FRAMES) < 5, saturated=False)
    assert bent
    assert spike[beyond].all()
    fitted = (scan @ protocol.orthonormal.T).reshape(clean.shape)
    assert np.abs(fitted - clean).max() < 10 * NOISE_V


@pytest.mark.parametrize("wrong", ["limited alone", "stuck"])
def test_a_channel_whose_error_no_limit_of_the_converter_is_stands(wrong: str) -> None:
    protocol, rng = Protocol.against_sink(electrode_pairs(16), 16, 1e-4), np.random.default_rng(10)
    pairs = 3e4 * (1 + rng.random(protocol.electrodes * (protocol.electrodes - 1) // 2))
    voltage = np.repeat(protocol.readings(pairs[None]), FRAMES, axis=0)
    own = voltage[..., 3]
    voltage[..., 3] = np.minimum(own, np.median(own)) if wrong == "limited alone" else 1.2
    voltage += 1e-4 * rng.standard_normal(voltage.shape)
    _, spike, bent = _scans(protocol, voltage, np.arange(FRAMES) < 5, saturated=False)
    assert not bent
    assert not spike[..., 3].any()


def test_a_channel_whose_readings_are_all_spikes_is_put_back_whole(protocol: Protocol) -> None:
    voltage = readings(protocol, 9)
    scan, spike = despiked(protocol, voltage)
    spike[..., 3] = True
    _, kept = _channels_restored(protocol, voltage, scan, spike)
    assert not kept[..., 3].any()


def test_a_channel_of_low_gain_is_no_bent_converter(protocol: Protocol) -> None:
    voltage = readings(protocol, 7)
    largest = int(voltage.max(axis=(0, 1)).argsort()[-2])
    voltage[..., largest] *= 0.9975
    scan, spike = despiked(protocol, voltage)
    fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    top = fitted > np.quantile(fitted, 1 - 3e-3)
    assert spike[top].mean() > 0.01
    assert spike[top].mean() > 20 * spike.mean()
    assert not _bent_at_top(voltage, fitted, spike)


def test_where_rest_frames_are_straight_nothing_bent_is_put_back(protocol: Protocol) -> None:
    voltage = readings(protocol, 3)
    rest = np.arange(FRAMES) < 3
    voltage[rest] *= 0.9
    knee = float(np.quantile(voltage, 0.9995))
    bent = np.where(voltage > knee, knee + 0.2 * (voltage - knee), voltage)
    scan, spike = despiked(protocol, bent)
    fitted = (scan @ protocol.orthonormal.T).reshape(bent.shape)
    assert _bent_at_top(bent, fitted, spike)
    assert _bent_from(fitted[rest], spike[rest]) == np.inf


def test_a_dead_channel_leaves_the_noise_as_it_is(protocol: Protocol) -> None:
    voltage = readings(protocol, 5)
    voltage[..., 7] = np.nan
    _, fitted, spike = split(protocol, voltage)
    assert spike[..., 7].all()
    freedom = leftover_freedom(protocol, np.isfinite(voltage).all(axis=0))
    leftover = np.where(spike, 0.0, voltage - fitted) / np.sqrt(np.maximum(freedom, 0.05))
    assert _leftover_noise_v(leftover, spike, np.ones(FRAMES, dtype=bool)) == pytest.approx(NOISE_V, rel=0.02)


def test_a_coarse_converter_that_names_no_step_is_not_saturated(protocol: Protocol) -> None:
    step_v = 5 * NOISE_V
    coarse = step_v * np.round(readings(protocol, 6) / step_v)
    assert (coarse == coarse.max()).sum() > 1
    repeated = np.repeat(coarse, 30, axis=0)
    assert _saturation(repeated, protocol) is None
    # Plainly at its limit: where it is coarse, a few steps below the top hold many readings, too.
    limit = float(np.quantile(repeated, 0.3))
    assert _saturation(np.minimum(repeated, limit), protocol) == limit


def test_noise_by_few_rest_frames_is_known_as_well_as_it_says() -> None:
    rng = np.random.default_rng(0)
    rests, numbers = 13, 104
    frames = rng.standard_normal((300, rests, numbers))
    rest, spike = np.ones(rests, dtype=bool), np.zeros((rests, numbers), dtype=bool)
    found = np.array([_leftover_noise_v(each, spike, rest) for each in frames])
    assert found.mean() == pytest.approx(1.0, abs=0.005)
    assert found.std() == pytest.approx(_noise_error(rests, numbers), rel=0.15)
    frames[:, 5, ::20] = 50.0
    spoilt = np.array([_leftover_noise_v(each, spike, rest) for each in frames])
    assert spoilt.mean() == pytest.approx(1.0, abs=0.03)


def test_noise_of_a_scan_without_a_reading_to_spare_is_known_by_all_its_numbers() -> None:
    rng = np.random.default_rng(0)
    current = 1e-4 * (np.eye(24)[:1] - np.eye(24)[-1:])
    protocol = Protocol.differences(current, np.column_stack((np.arange(23), np.arange(1, 24))))
    width = protocol.orthonormal.shape[1]
    assert protocol.count == width
    rest = np.ones(13, dtype=bool)
    scans = 7.0 + rng.standard_normal((600, len(rest), width))
    found = np.array([_noise_v(protocol, each, np.zeros(0), np.zeros(0, dtype=bool), rest) for each in scans])
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert found.std() == pytest.approx(_noise_error(len(rest), width), rel=0.15)
