"""Which frames are fitted and which are kept for the proof."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.recording.evidence import CannotTell
from ertskin.diagnosis.recording.split import all_fitted, fitted_and_held, folds_of
from ertskin.physics.history import History

PRESSES, FRAMES = 6, 5


def evidence(presses: int = PRESSES) -> Any:
    """Presses of one rest frame and four with a contact whose depth is known."""
    count = presses * FRAMES
    air = np.arange(count) % FRAMES == 0
    history = History(
        time_s=np.arange(count, dtype=float),
        phase=np.where(air, 0, 1).astype(np.uint8),
        press=np.repeat(np.arange(presses), FRAMES),
        contact_m=np.where(air[:, None, None], np.nan, 0.05),
        depth_m=np.where(air, np.nan, 1e-3)[:, None],
        force_n=np.full((count, 1), np.nan),
    )
    return SimpleNamespace(history=history, scan_v=np.zeros((count, 3)), rest=air)


def test_whole_presses_are_held_out_and_only_their_pressed_frames_are_judged_on() -> None:
    seen = evidence()
    fitted, held = fitted_and_held(seen)
    press = seen.history.press
    assert len(np.unique(press[held])) == PRESSES // 3
    assert not np.isin(press[fitted], press[held]).any()
    assert not seen.rest[held].any()
    assert seen.rest[fitted].sum() == PRESSES - PRESSES // 3
    assert len(fitted) + len(held) == PRESSES * FRAMES - PRESSES // 3


def test_a_press_with_neither_force_nor_depth_is_not_used() -> None:
    seen = evidence()
    lost = seen.history.press == 2
    seen.history.depth_m[lost] = np.nan
    fitted, held = fitted_and_held(seen)
    used = np.concatenate([fitted, held])
    assert seen.rest[used[lost[used]]].all()


def test_two_presses_leave_nothing_to_predict() -> None:
    with pytest.raises(CannotTell, match="2 presses"):
        fitted_and_held(evidence(2))


def test_all_frames_that_can_be_fitted_and_their_presses() -> None:
    rows, presses = all_fitted(evidence())
    np.testing.assert_array_equal(rows, np.arange(PRESSES * FRAMES))
    assert presses == PRESSES
    lost = evidence()
    lost.history.depth_m[lost.history.press == 2] = np.nan
    assert all_fitted(lost)[1] == PRESSES - 1


def test_folds_hold_whole_presses_one_of_any_six_on_end_and_no_column_of_a_grid() -> None:
    press = np.repeat(np.arange(36), 4)
    fold = folds_of(press, 6)
    by_press = fold[::4]
    assert np.array_equal(fold, np.repeat(by_press, 4))
    assert all(sorted(by_press[k : k + 6]) == list(range(6)) for k in range(0, 36, 6))
    columns = [np.flatnonzero(by_press == k) % 6 for k in range(6)]
    assert min(len(set(column)) for column in columns) >= 3
    assert np.array_equal(folds_of(press, 6), fold)


def test_folds_of_presses_that_are_fewer_than_folds_differ() -> None:
    assert sorted(folds_of(np.array([4, 4, 7, 9]), 6)[[0, 2, 3]]) == [0, 1, 2]
