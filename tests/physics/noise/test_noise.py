"""Every noise model's samples have the covariance it states; what rest frames carry is recovered."""

import numpy as np
import pytest

from ertskin.data.baseline import others_weights
from ertskin.physics.noise import GaussianNoise, MeasuredNoise, NoNoise, WhiteNoise
from ertskin.physics.noise.measured import CHANCE
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.spikes import despiked

ELECTRODES = 8
PROTOCOL = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-4)
PAIRS = ELECTRODES * (ELECTRODES - 1) // 2
READINGS = PAIRS * ELECTRODES


def rest_frames(rng, frames=60, spike_rate=0.01):
    drift = np.zeros((2, PAIRS))
    drift[0, 3], drift[1, 10] = 0.5, 0.2
    truth = MeasuredNoise(PROTOCOL, 2e-3, drift, spike_rate, np.array([-0.3, 0.3]))
    rest = PROTOCOL.readings(np.full(PAIRS, 1e4)).ravel()
    return truth, (rest + truth.readings(rng, frames)).reshape(frames, *PROTOCOL.shape)


def models():
    rng = np.random.default_rng(1)
    residual = 1e-3 * rng.standard_normal((40, *PROTOCOL.shape)) + 5e-4
    return [
        NoNoise(PROTOCOL),
        WhiteNoise(PROTOCOL, 2e-3),
        GaussianNoise.from_residuals(PROTOCOL, residual),
        rest_frames(rng)[0],
    ]


@pytest.mark.parametrize("noise", models(), ids=lambda noise: type(noise).__name__)
def test_samples_have_the_stated_covariance(noise):
    sample = noise.coordinates(np.random.default_rng(0), 20_000)
    scale = np.sqrt(np.diag(noise.covariance_v2)).max() ** 2 or 1.0
    assert np.abs(np.cov(sample.T) - noise.covariance_v2).max() < 0.05 * scale
    assert np.array_equal(sample, noise.coordinates(np.random.default_rng(0), 20_000))


@pytest.mark.parametrize("noise", models(), ids=lambda noise: type(noise).__name__)
def test_readings_project_onto_the_coordinates(noise):
    rng = np.random.default_rng(0)
    reduced = noise.readings(rng, 3000) @ PROTOCOL.orthonormal
    direct = noise.coordinates(np.random.default_rng(1), 3000)
    spikes = getattr(noise, "spike_rate", 0.0)
    assert reduced.std() == pytest.approx(direct.std(), rel=0.05 if not spikes else 0.5, abs=1e-12)


def test_rest_frames_give_back_noise_drift_and_spikes():
    truth, frames = rest_frames(np.random.default_rng(5))
    found = MeasuredNoise.from_rest(PROTOCOL, frames)
    assert found.std_v == pytest.approx(truth.std_v, rel=0.1)
    assert found.spike_rate == pytest.approx(truth.spike_rate, rel=0.3)
    assert len(found.drift_v) == 2
    assert np.linalg.norm(found.drift_v, axis=1) == pytest.approx([0.5, 0.2], rel=0.35)


def test_what_is_known_to_wander_is_measured_along_it():
    rng = np.random.default_rng(8)
    slope = rng.standard_normal((PAIRS, 9))
    spread = np.array([0.3] * 4 + [0.1] * 4 + [0.0])
    truth = MeasuredNoise(PROTOCOL, 2e-3, spread[:, None] * slope.T, 0.0, np.zeros(1))
    rest = PROTOCOL.readings(np.full(PAIRS, 1e4)).ravel()
    frames, others = ((rest + truth.readings(rng, count)).reshape(count, *PROTOCOL.shape) for count in (12, 400))
    unseen = despiked(PROTOCOL, others)[0] - despiked(PROTOCOL, frames)[0].mean(axis=0)

    def square(noise):
        """Mean square of frames that the noise was not measured on, in its own units: 1 where it is right."""
        whitened = np.linalg.solve(np.linalg.cholesky(noise.covariance_v2), unseen.T)
        return np.median((whitened**2).mean(axis=0))

    along = MeasuredNoise.from_rest(PROTOCOL, frames, slope)
    size = np.linalg.norm(along.drift_v, axis=1) / np.linalg.norm(slope, axis=0)
    assert size[:8] == pytest.approx(spread[:8], rel=0.6)
    assert size[8] < 1e-3
    assert square(along) == pytest.approx(1.0, abs=0.25)
    # Directions taken from twelve frames are off by the noise in all the other numbers.
    assert square(MeasuredNoise.from_rest(PROTOCOL, frames)) > 1.5


@pytest.mark.parametrize("neighbours", [False, True])
def test_what_does_not_wander_is_given_no_noise_by_chance(neighbours):
    rng = np.random.default_rng(4)
    slope = rng.standard_normal((PAIRS, 9))
    truth = MeasuredNoise(PROTOCOL, 2e-3, np.zeros((0, PAIRS)), 0.0, np.zeros(1))
    rest = PROTOCOL.readings(np.full(PAIRS, 1e4)).ravel()
    zero = 0.5 * (np.eye(12, k=1) + np.eye(12, k=-1)) if neighbours else None
    if zero is not None:
        zero[[0, -1]] *= 2.0
    found = sum(
        len(
            MeasuredNoise.from_rest(
                PROTOCOL, (rest + truth.readings(rng, 12)).reshape(12, *PROTOCOL.shape), slope, zero
            ).drift_v
        )
        for _ in range(40)
    )
    # Of a Poisson number as expected more than nine come once in two hundred times.
    assert found <= 40 * 9 * CHANCE + 5.4


def test_what_the_frames_before_and_after_predict_is_no_noise():
    rng = np.random.default_rng(3)
    slope = rng.standard_normal((PAIRS, 2))
    truth = MeasuredNoise(PROTOCOL, 2e-3, np.zeros((0, PAIRS)), 0.0, np.zeros(1))
    walk = np.cumsum(0.05 * rng.standard_normal((60, 2)), axis=0) @ slope.T
    rest = PROTOCOL.readings(np.full(PAIRS, 1e4)).ravel()
    frames = (rest + truth.readings(rng, 60) + walk @ PROTOCOL.orthonormal.T).reshape(60, *PROTOCOL.shape)
    coordinates, _ = despiked(PROTOCOL, frames)
    near = others_weights(np.arange(60.0), coordinates)
    assert (near > 0).sum(axis=1).max() == 2
    size = [
        np.linalg.norm(MeasuredNoise.from_rest(PROTOCOL, frames, slope, zero).drift_v, axis=1) for zero in (None, near)
    ] / np.linalg.norm(slope, axis=0)
    # A step of a walk from the mean of its neighbours: half the variance of one, over the zero's own part.
    assert size[1] == pytest.approx(0.05 / np.sqrt(3.0), rel=0.4)
    assert (size[0] > 2.0 * size[1]).all()


def test_spikes_leave_the_reduction_as_good_as_white_noise():
    _, frames = rest_frames(np.random.default_rng(5), spike_rate=0.0)
    spiky = frames.copy()
    hit = np.random.default_rng(6).random(frames.shape) < 0.02
    spiky[hit] += 0.4
    spiky[0, 0, 0] = np.nan
    clean, _ = despiked(PROTOCOL, frames)
    reduced, flagged = despiked(PROTOCOL, spiky)
    assert (reduced - clean).std() < 2e-3
    assert flagged[hit].mean() > 0.95
    assert flagged[~hit].mean() < 0.01


def test_too_few_frames_are_refused():
    with pytest.raises(ValueError, match="at least three rest frames"):
        MeasuredNoise.from_rest(PROTOCOL, np.zeros((2, *PROTOCOL.shape)))
    with pytest.raises(ValueError, match="at least two real trials"):
        GaussianNoise.from_residuals(PROTOCOL, np.zeros((1, *PROTOCOL.shape)))
