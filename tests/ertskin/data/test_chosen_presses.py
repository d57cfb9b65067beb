"""A recording thinned to some of its presses."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ertskin.data.chosen_presses import made_presses, presses_of
from ertskin.errors import UserError
from ertskin.hardware.recording import Recording

sys.path.insert(0, str(Path(__file__).parents[2] / "hardware"))
from small_experiment import bench_of, experiment_of, plan_of_presses, recorder_of


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    bench, plan = bench_of(), plan_of_presses(4)
    recorder = recorder_of(bench, plan, tmp_path_factory.mktemp("made") / "a.h5")
    experiment_of(bench, recorder).run(plan)
    bench.close()
    return recorder.finish()


def test_chosen_presses_stay_as_they_were_with_the_rest_around_them(recording: Recording) -> None:
    thinned = presses_of(recording, [2, 0])
    whole, kept = recording.frames, thinned.frames
    assert whole is not None
    assert kept is not None
    expected = np.isin(whole.history.press, [0, 2])
    expected[np.flatnonzero(whole.history.press == 3)[0]] = True
    np.testing.assert_array_equal(kept.voltage_v, whole.voltage_v[expected])
    np.testing.assert_array_equal(kept.history.time_s, whole.history.time_s[expected])
    assert made_presses(kept).tolist() == [0, 2]
    assert kept.history.phase[-1] == kept.history.phase[0] == 0
    assert thinned.protocol is recording.protocol


def test_all_presses_are_the_whole_recording(recording: Recording) -> None:
    kept, whole = presses_of(recording, range(4)).frames, recording.frames
    assert kept is not None
    assert whole is not None
    np.testing.assert_array_equal(kept.voltage_v, whole.voltage_v)


@pytest.mark.parametrize(
    ("which", "expected"), [([], "no press was chosen"), ([1, 7], "has no press 7; choose from 0 to 3")]
)
def test_presses_that_are_not_there_are_refused(recording: Recording, which: list[int], expected: str) -> None:
    with pytest.raises(UserError, match=expected):
        presses_of(recording, which)
