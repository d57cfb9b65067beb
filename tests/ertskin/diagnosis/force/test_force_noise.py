"""A misfit of force counts where it is more than the cell's noise, as surely as the noise is known."""

import numpy as np

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.force.noise import ForceNoise


def test_noise_known_from_a_dozen_frames_is_seldom_exceeded_by_the_same_noise():
    rng = np.random.default_rng(0)
    exceeded = 0
    for _ in range(2000):
        noise = ForceNoise(float(rng.standard_normal(13).std(ddof=1)), 12)
        exceeded += noise.exceeded(float(np.sqrt(np.mean(rng.standard_normal(96) ** 2))), 96, DEFAULT)
    assert exceeded <= 2000 * DEFAULT.force_chance * 10


def test_a_misfit_of_half_the_noise_on_top_is_seen_where_the_noise_is_known_well():
    assert ForceNoise(0.01, 400).exceeded(0.015, 96, DEFAULT)
    assert not ForceNoise(0.01, 12).exceeded(0.015, 96, DEFAULT)


def test_what_is_hardly_more_does_not_count_however_sure_it_is():
    assert not ForceNoise(0.01, 10**7).exceeded(0.0105, 10**6, DEFAULT)


def test_a_lost_motion_is_seen_by_its_sign_though_it_is_no_larger_than_the_noise():
    rng = np.random.default_rng(1)
    phase = np.repeat([1, 3], 48)
    noise = 0.01 * rng.standard_normal(96)
    cell = ForceNoise(0.01, 88)
    lost = noise + np.where(phase == 1, -0.007, 0.009)
    assert cell.leans(lost, phase, DEFAULT)
    assert not cell.exceeded(float(np.sqrt(np.mean(lost**2))), 96, DEFAULT)
    assert not cell.leans(rng.permutation(lost), phase, DEFAULT)
    assert not any(cell.leans(0.01 * rng.standard_normal(96), phase, DEFAULT) for _ in range(1000))
