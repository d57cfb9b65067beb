"""Plans: the paper's, those of tests, those from a YAML or a diagnosis, and those that can't be."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ertskin.hardware.plan import (
    Plan,
    PlanError,
    Press,
    one_point_test,
    pairs_of,
    plan_from_presses,
    plan_of,
    ramp,
    repeated,
    taxel_plan,
    two_point_test,
)
from ertskin.physics.history import Phase
from ertskin.physics.sensor import taxel_grid_m

TAXELS = taxel_grid_m((0.12, 0.12), 6, 6)


def test_the_papers_experiment() -> None:
    plan = taxel_plan(TAXELS)
    assert len(plan.presses) == 36
    depths = [step.depth_m for step in plan.presses[0].steps if step.phase == Phase.LOADING]
    np.testing.assert_allclose(depths, 1e-4 * np.arange(41), atol=1e-12)
    back = [step.depth_m for step in plan.presses[0].steps if step.phase == Phase.UNLOADING]
    np.testing.assert_allclose(back, depths[-2::-1])
    assert plan.frames == 36 * (1 + 41 + 4 + 40) + 1
    assert plan.period_s == 0.5


def test_duration_counts_frames_rests_and_moves() -> None:
    plan = Plan("one", (Press(((0.0, 0.0),), ramp(1e-3, 5e-4, 0, unloading=False), rest_frames=2, rest_s=3.0),))
    # Three frames (the two moves of 0.5 s fit between them), two at rest, one at the end, 3 s rest, 6 s travel.
    assert plan.duration_s(travel_s=6.0) == pytest.approx(3 * 0.5 + 2 * 0.5 + 0.5 + 3.0 + 6.0)


def test_test_plans_press_elsewhere() -> None:
    calibrated = {round(1e4 * k) for k in np.linspace(0, 4e-3, 9)}
    tested = {round(1e4 * (step.depth_m or 0.0), 1) for step in one_point_test(TAXELS).presses[0].steps}
    assert len(tested) == 8
    assert not tested & calibrated
    two = two_point_test(TAXELS, [(0, 35), (7, 28)])
    assert two.contacts == 2
    assert two.presses[0].weight_n == pytest.approx(4.903, abs=1e-3)


def test_skins_of_other_sizes_have_pairs_of_their_own() -> None:
    assert len(pairs_of(TAXELS)) == 14
    assert pairs_of(TAXELS)[0] == (0, 35)
    for nx, ny, count in ((2, 1, 1), (3, 3, 3), (4, 4, 7), (10, 10, 14)):
        taxel_m = taxel_grid_m((0.12, 0.12), nx, ny)
        pairs = pairs_of(taxel_m)
        assert len(pairs) >= count
        assert len({k for pair in pairs for k in pair}) == 2 * len(pairs)
        apart_m = [np.linalg.norm(np.subtract(*press.contact_m)) for press in two_point_test(taxel_m, pairs).presses]
        assert min(apart_m) >= np.linalg.norm(taxel_m[-1] - taxel_m[0]) / 3 - 1e-12
    with pytest.raises(PlanError, match="need two taxels, the sensor has 1"):
        pairs_of(TAXELS[:1])


@pytest.mark.parametrize("pair", [(0, 35), (3, 3), (1, 2, 3), (4,), (-1, 2), (0.0, 1), (True, 2), ("a", 1), 5])
def test_what_is_no_pair_of_taxels_is_refused(pair: object) -> None:
    with pytest.raises(PlanError, match="expected two different taxels of 0 to 15"):
        two_point_test(TAXELS[:16], [(0, 1), pair])  # type: ignore[list-item]
    with pytest.raises(PlanError, match="no pairs: null chooses them"):
        two_point_test(TAXELS[:16], [])


def test_a_plan_survives_builtin_types() -> None:
    for plan in (taxel_plan(TAXELS[:3]), two_point_test(TAXELS, [(0, 35)]), repeated(one_point_test(TAXELS[:2]), 2)):
        assert plan_of(json.loads(json.dumps(plan.as_dict()))) == plan


def wanted(**changes: object) -> dict[str, object]:
    """A press as a diagnosis asks for it."""
    asked = {"position_m": [0.03, 0.05], "depth_m": 2e-3, "hold_s": 60.0, "speed_m_per_s": 1e-3, "cycles": 2}
    return {**asked, **changes}


def test_a_diagnosis_asks_for_presses() -> None:
    plan = plan_from_presses([wanted(), wanted(position_m=[0.07, 0.05], speed_m_per_s=1e-4, cycles=1, hold_s=0.0)])
    first, second = plan.presses
    assert first.contact_m == ((0.03, 0.05),)
    assert (first.depth_m, first.speed_m_s, second.speed_m_s) == (2e-3, 1e-3, 1e-4)
    held = [sum(step.frames for step in press.steps if step.phase == Phase.HOLD) for press in plan.presses]
    assert held == [2 * 60.0 / plan.period_s, 1]
    turns = [step.depth_m for step in first.steps if step.phase != Phase.HOLD]
    np.testing.assert_allclose(turns, 2 * [0.0, 5e-4, 1e-3, 1.5e-3, 2e-3, 1.5e-3, 1e-3, 5e-4, 0.0])
    slow = [step.depth_m for step in second.steps if step.phase == Phase.LOADING]
    np.testing.assert_allclose(slow, 1e-4 * np.arange(21), atol=1e-12)
    assert plan_of(json.loads(json.dumps(plan.as_dict()))) == plan


@pytest.mark.parametrize(
    "presses",
    [
        None,
        [],
        "all",
        [1],
        [{"position_m": [0.0, 0.0]}],
        [wanted(position_m=None)],
        [wanted(depth_m=0.0)],
        [wanted(speed_m_per_s=0.0)],
        [wanted(cycles=0)],
        [wanted(cycles=1.5)],
        [wanted(hold_s=-1.0)],
        [wanted(force_n=3.0)],
    ],
)
def test_what_a_diagnosis_can_not_ask_for(presses: object) -> None:
    with pytest.raises(PlanError, match="press"):
        plan_from_presses(presses)


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({}, "list of presses"),
        ({"presses": []}, "list of presses"),
        ({"presses": "all"}, "list of presses"),
        ({"presses": [1]}, r"presses\[0\]"),
        ({"presses": [{"contact_m": [0.0, 0.0]}]}, "no steps"),
        ({"presses": [{"contact_m": [0.0], "ramp": {}}]}, "no place"),
        ({"presses": [{"contact_m": [0.0, "x"], "ramp": {}}]}, "no number"),
        ({"presses": [{"contact_m": [0.0, 0.0], "ramp": {"deep": 1}}]}, "ramp"),
        ({"presses": [{"contact_m": [0.0, 0.0], "ramp": {}, "speed_m_s": 0}]}, "speed_m_s"),
        ({"presses": [{"contact_m": [0.0, 0.0], "ramp": {}, "spede": 1}]}, "spede"),
        ({"presses": [{"contact_m": [0.0, 0.0], "steps": [{"phase": "down"}]}]}, "phase"),
        ({"presses": [{"contact_m": [0.0, 0.0], "steps": [{"phase": "hold", "depth_m": -1}]}]}, "depth_m"),
        ({"presses": [{"contact_m": [0.0, 0.0], "ramp": {}}], "period_s": 0}, "period_s"),
    ],
)
def test_what_is_no_plan(fields: dict[str, object], what: str) -> None:
    with pytest.raises(PlanError, match=what):
        plan_of(fields)
