"""A misfit of force counts where it is more than the cell's noise, as surely as the noise is known."""

import numpy as np

from ertskin.diagnosis.force_noise import SURELY, ForceNoise


def test_noise_known_from_a_dozen_frames_is_seldom_exceeded_by_the_same_noise():
    rng = np.random.default_rng(0)
    exceeded = 0
    for _ in range(2000):
        noise = ForceNoise(float(rng.standard_normal(13).std(ddof=1)), 12)
        exceeded += noise.exceeded(float(np.sqrt(np.mean(rng.standard_normal(96) ** 2))), 96)
    assert exceeded <= 2000 * SURELY * 10


def test_a_misfit_of_half_the_noise_on_top_is_seen_where_the_noise_is_known_well():
    assert ForceNoise(0.01, 400).exceeded(0.015, 96)
    assert not ForceNoise(0.01, 12).exceeded(0.015, 96)


def test_what_is_hardly_more_does_not_count_however_sure_it_is():
    assert not ForceNoise(0.01, 10**7).exceeded(0.0105, 10**6)
