"""A misfit of force counts where it is more than the cell's noise, as surely as the noise is known."""

import numpy as np

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.force.noise import ForceNoise, pressed_noise
from ertskin.physics.history import History, Phase


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


def test_noise_is_what_changes_from_frame_to_frame_of_a_press():
    """A drift, and presses that don't repeat, are none; a scatter far above what air shows is no noise of the cell."""
    rng, presses, frames = np.random.default_rng(2), 30, 15
    press = np.repeat(np.arange(presses), frames)
    depth = np.tile(np.r_[np.arange(1, 9), np.arange(7, 0, -1)] / 8e3, presses)[:, None]
    phase = np.full(len(press), Phase.LOADING, dtype=np.uint8)
    time_s = np.arange(len(press), dtype=float)
    history = History(time_s, press, phase, np.zeros((len(press), 1, 2)), depth, 2000.0 * depth)
    white = 0.01 * rng.standard_normal(len(press))
    smooth = 0.05 * np.sin(time_s / 100) + 0.03 * rng.standard_normal(presses)[press]
    found = pressed_noise(history, (white + smooth)[:, None], ForceNoise(0.02, 30))
    assert found.freedom > 150
    assert abs(found.rms_n / 0.01 - 1) < 3 / np.sqrt(2 * found.freedom)
    assert pressed_noise(history, 10 * white[:, None], ForceNoise(0.02, 30)) == ForceNoise(0.02, 30)
    assert pressed_noise(history, np.full((len(press), 1), np.nan), ForceNoise(0.02, 30)) == ForceNoise(0.02, 30)
