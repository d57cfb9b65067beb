"""The parts of a diagnosis that need no recording: least squares, claims, what is written, bad input."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.contract.claims import (
    Claim,
    Diagnosis,
    Estimate,
    HeldOut,
    Tried,
    confidences,
    gathered,
    verdict_of,
)
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.bounded_step import Region
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.levenberg_marquardt import Fit, descend
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.force.fit import ForceData, fit_force, force_starts
from ertskin.diagnosis.force.selection import select_force_effects
from ertskin.diagnosis.judge.held_out import broad_ratio
from ertskin.diagnosis.linear.sensitivity import Hats
from ertskin.diagnosis.output.diagnosis_file import write_diagnosis, write_effects
from ertskin.diagnosis.output.names import config_name
from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.registry import build_effects
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam
from ertskin.physics.history import History, Phase
from ertskin.physics.mechanics.reaction import foam_force_n
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import Sensor, rectangle_m


def silent(share: float | None, text: str) -> None:
    """No progress."""


def test_descent_finds_a_bounded_minimum() -> None:
    matrix, target = np.array([[2.0, 0.3], [0.1, 1.0], [0.5, 0.5]]), np.array([1.0, 5.0, 2.0])

    def linearise(x):
        wrong = target - matrix @ x
        return Quadratic(np.array([0.5 * wrong @ wrong]), (matrix.T @ wrong)[None], (matrix.T @ matrix)[None])

    low, high = np.array([-10.0, -10.0]), np.array([10.0, 3.0])
    fit = descend(
        linearise,
        lambda x: float(linearise(x).cost[0]),
        np.zeros(2),
        Region(low, high),
        np.zeros(2),
        np.zeros(2),
        tolerance=1e-12,
    )
    assert fit.value[1] == pytest.approx(3.0)
    wrong = target - 3.0 * matrix[:, 1]
    assert fit.value[0] == pytest.approx(matrix[:, 0] @ wrong / (matrix[:, 0] @ matrix[:, 0]), rel=1e-6)


def test_no_step_of_a_descent_is_longer_than_asked() -> None:
    """The second number hardly shows until it is near: one Newton step takes it out of sight."""
    target = np.array([1.0, 1.0])

    def shown(x):
        return np.array([x[0] + 0.1 * x[1], 2.0 / (1 + x[1] ** 2)])

    def slope(x):
        return np.array([[1.0, 0.1], [0.0, -4.0 * x[1] / (1 + x[1] ** 2) ** 2]])

    asked = []

    def cost(x):
        asked.append(x)
        return 0.5e4 * float(((target - shown(x)) ** 2).sum())

    def linearise(x):
        matrix, wrong = 1e2 * slope(x), 1e2 * (target - shown(x))
        return Quadratic(np.array([0.5 * wrong @ wrong]), (matrix.T @ wrong)[None], (matrix.T @ matrix)[None])

    wide = np.full(2, 1e3)
    fit = descend(
        linearise,
        cost,
        np.array([0.0, 0.05]),
        Region(-wide, wide),
        np.zeros(2),
        np.zeros(2),
        longest=np.array([np.inf, 0.5]),
    )
    assert np.abs(np.diff([x[1] for x in asked])).max() <= 1.0
    assert abs(asked[1][1] - 0.05) == pytest.approx(0.5)
    assert fit.value[1] == pytest.approx(1.0, abs=1e-3)
    assert fit.from_prior == pytest.approx(fit.value)


def test_a_fit_taken_up_again_counts_what_it_counted() -> None:
    asked: list[dict[str, object]] = []

    class Problem(VoltageProblem):
        def __init__(self) -> None:
            self._latest = None

        def solve(self, terms, start, **settings):
            asked.append(settings)

    fit = Fit(np.zeros(1), Quadratic(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1, 1))), np.zeros((1, 1)), 1)
    for leftover in (True, False):
        Problem().at_hand(Solved(None, (), fit, np.zeros((1, 1)), leftover))
    assert [settings["leftover"] for settings in asked] == [True, False]


def test_hats_sum_to_one_and_reproduce_a_plane() -> None:
    hats = Hats(np.array([0.0, 0.01]), np.array([0.05, 0.04]), 2e-3)
    at = np.random.default_rng(1).uniform([0.0, 0.01], [0.05, 0.04], (50, 2))
    values = hats.values(at)
    np.testing.assert_allclose(values.sum(axis=0), 1.0)
    np.testing.assert_allclose((values.T @ hats.node_m), at, atol=1e-12)


def test_confidence_is_shared_with_rivals_that_fit_as_well() -> None:
    alone, nothing = confidences((("piezo_creep", 500.0),), DEFAULT)
    assert alone == 0.99
    assert nothing == ()
    tied, rivals = confidences((("piezo_creep", 0.0),), DEFAULT)
    assert tied == pytest.approx(0.5)
    assert rivals == (("piezo_creep", 0.5),)


@pytest.mark.parametrize(
    ("before", "after", "named", "expected"),
    [
        (1.01, 1.01, False, "no_mismatch"),
        (1.4, 1.4, False, "unexplained"),
        (1.4, 1.02, True, "explained"),
        (3.0, 1.4, True, "partly_explained"),
    ],
)
def test_verdicts(before: float, after: float, named: bool, expected: str) -> None:
    assert verdict_of(before, after, named, DEFAULT) == expected


def test_written_diagnosis_keeps_the_contract_and_its_effects_build(tmp_path) -> None:
    effect = PiezoHysteresis(width=0.15)
    claim = Claim(effect, 0.97, 1.2, {"width": Estimate(0.15, 0.14, 0.16, "1")}, (("piezo_creep", 0.03),))
    held = HeldOut("every third press", 0.002, 1.8, 1.01, 1e-12, 0.5, 0.02)
    tried = (Tried(("piezo_creep",), 12.04, False), Tried(("piezo_hysteresis",), 90.0, True))
    said = Diagnosis("a.h5", "explained", held, "piezoresistance", claims=(claim,), specimen="agrees", tried=tried)
    found = json.loads(write_diagnosis(tmp_path, said).read_text())
    assert found["specimen"] == "agrees"
    assert found["tried"][0] == {"effects": ["piezo_creep"], "gain": 12.0, "kept": False}
    assert found["format"] == "ertskin-diagnosis"
    assert found["format_version"] == 1
    assert set(found["where"]) == {"stage", "electrodes", "position_m", "radius_m", "depends_on"}
    assert found["effects"][0]["parameters"]["width"] == {
        "value": 0.15,
        "low": 0.14,
        "high": 0.16,
        "unit": "1",
        "level": 0.9,
    }
    assert found["held_out"]["force"] == {"rmse_before_n": 0.5, "rmse_after_n": 0.02}
    written = write_effects(tmp_path, config_name(tmp_path / "a b.h5"), (effect,), "a b.h5")
    assert written.name == "a_b.yaml"
    assert build_effects(yaml.safe_load(written.read_text())) == (effect,)


def test_names_that_spoil_the_prediction_are_said_but_not_handed_on() -> None:
    held = HeldOut("s", 2e-5, 2.3, 7.7, 0.5)
    said = Diagnosis("a.h5", "partly_explained", held, claims=(Claim(PiezoHysteresis(width=0.1), 0.4, 2.0, {}),))
    assert said.effects
    assert said.as_builtins()["handed_on"] is True
    spoilt = replace(said, spoilt=True)
    assert spoilt.effects == ()
    assert spoilt.as_builtins()["handed_on"] is False
    assert spoilt.as_builtins()["effects"] == said.as_builtins()["effects"]


def strokes(presses: int) -> History:
    depth = np.tile(np.r_[np.nan, 0.5e-3 * np.arange(1, 9), [4e-3] * 3, 0.5e-3 * np.arange(7, 0, -1)], presses)
    phase = np.tile(np.r_[0, np.ones(8), np.full(3, 2), np.full(7, 3)], presses).astype(np.uint8)
    wait = np.tile(np.r_[10.0, np.full(8, 0.5), [4.0] * 3, np.full(7, 0.5)], presses)
    press = np.repeat(np.arange(presses), 19)
    contact = np.stack([0.02 * (press % 5), 0.02 * (press // 5)], axis=1)
    return History(np.cumsum(wait), press, phase, contact[:, None], depth[:, None], np.full((len(depth), 1), np.nan))


@pytest.mark.parametrize(
    "hidden",
    [(), (NonlinearFoam(stiffening=0.4),), (ViscoelasticFoam(fraction=0.2, time_s=4.0),)],
    ids=["none", "stiffening", "relaxation"],
)
def test_force_stage_names_what_the_load_cell_shows(hidden) -> None:
    history = strokes(9)
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, hidden)
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004)
    linear, best = select_force_effects(data, history.press % 3, 10.0, 0.1)
    assert tuple(e.name for e in best.effects) == tuple(e.name for e in hidden)
    for found, true in zip(best.effects, hidden, strict=True):
        key = next(iter(true.parameters()))
        assert getattr(found, key) == pytest.approx(getattr(true, key), rel=0.1)
    assert best.chi_square <= linear.chi_square


def test_force_stage_names_no_foam_where_the_load_cell_drifts() -> None:
    history = strokes(12)
    force = foam_force_n(history, 1800.0, 9000.0, 0.004) + 0.03 * np.sin(history.time_s / 80)[:, None]
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004)
    best = select_force_effects(data, history.press % 3, 10.0, 0.1)[1]
    assert best.effects == ()
    assert best.remainder is not None
    assert "zero" in best.remainder.name
    assert best.chi_square > 1.5 * np.isfinite(best.residual).sum()
    # Nor where the search begins with one.
    foam = ViscoelasticFoam.force_starts()[:1]
    assert select_force_effects(data, history.press % 3, 10.0, 0.1, begun=foam)[1].effects == ()


@pytest.mark.parametrize(
    "hidden",
    [
        (FoamSoftening(excess=0.1, scale=0.5, driven_by="work"), NonlinearFoam(stiffening=0.2)),
        (FoamSoftening(excess=0.1, kept=1.0, scale=0.3, driven_by="energy"),),
        (ViscoelasticFoam(fraction=0.1, time_s=0.1, decades=3.0),),
    ],
    ids=["work beside stiffening", "energy", "decades"],
)
def test_one_form_of_foam_is_not_taken_for_two_effects(hidden) -> None:
    history = strokes(12)
    contact = np.where(history.press[:, None, None] % 2 == 0, history.contact_m, history.contact_m[:1])
    history = replace(history, contact_m=contact)
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, hidden)
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004)
    best = select_force_effects(data, history.press % 3, 10.0, 0.1)[1]
    assert {e.name for e in best.effects} == {e.name for e in hidden}
    assert best.chi_square < 1.2 * np.isfinite(best.residual).sum()


@pytest.mark.parametrize("scan_s", [0.02, 0.4, 2.0])
def test_a_stage_that_moves_while_force_is_read_is_no_foam(scan_s: float) -> None:
    """A share of the next step is made within the scan already."""
    history = strokes(9)
    way_m = np.gradient(np.nan_to_num(history.depth_m), axis=0)
    moving = np.isin(history.phase, [Phase.LOADING, Phase.UNLOADING])[:, None]
    depth_m = np.clip(history.depth_m + 0.08 * np.where(moving, way_m, 0.0), 0.0, np.nanmax(history.depth_m))
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, (), depth_m)
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004, scan_s)
    best = select_force_effects(data, history.press % 3, 10.0, 0.1)[1]
    assert [effect.name for effect in best.effects] == ["scan_skew"]
    assert best.effects[0].speed_m_per_s * scan_s / 2 == pytest.approx(0.08 * 0.5e-3, rel=0.2)  # type: ignore[union-attr]
    assert best.foam == ()


def test_play_of_the_stage_is_no_motion() -> None:
    """A stage whose screw has play lags behind whichever way it goes, however long one waits."""
    history = strokes(9)
    late = np.where(history.phase == Phase.UNLOADING, 20e-6, 0.0)[:, None]
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, (), history.depth_m + late)
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004, 0.4)
    best = select_force_effects(data, history.press % 3, 10.0, 0.1)[1]
    assert "scan_skew" not in [effect.name for effect in best.effects]


def test_what_an_effects_form_leaves_gets_no_name() -> None:
    history = strokes(9)
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, (ViscoelasticFoam(0.06, 0.6), ViscoelasticFoam(0.06, 60.0)))
    force = force + 0.01 * np.random.default_rng(3).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004)
    (_, anything), (_, best) = (select_force_effects(data, history.press % 3, 10.0, share) for share in (0.0, 0.1))
    assert [effect.name for effect in best.effects] == ["viscoelastic_foam"]
    assert len(anything.effects) == 2


@pytest.mark.parametrize("loss", [0.005, 0.02])
def test_a_loss_is_found_though_every_step_turns_it_right_round(loss: float) -> None:
    history = strokes(9)
    keep = np.isin(np.arange(19), [0, 2, 4, 6, 8, 9, 13, 15, 17])
    history = history[np.flatnonzero(np.tile(keep, 9))]
    hidden = (FoamHysteresis(loss=loss, reversal=0.25),)
    force = foam_force_n(history, 1800.0, 9000.0, 0.004, hidden)
    force = force + 0.01 * np.random.default_rng(4).standard_normal(force.shape)
    data = ForceData(replace(history, force_n=force), 0.01, 9000.0, 1e-3, 0.004)
    fits = [fit_force(data, [start]) for start in force_starts()["foam_hysteresis"]]
    best = min(fits, key=lambda fit: fit.chi_square)
    assert best.chi_square < 1.4 * data.used.sum()
    assert best.effects[0].loss == pytest.approx(loss, rel=0.25)  # type: ignore[attr-defined]


def recording(history: History | None, voltage: np.ndarray | None) -> Recording:
    protocol = Protocol.against_sink(electrode_pairs(5), 5, 1e-4)
    center = np.array([[0.01, 0.01], [0.05, 0.01], [0.05, 0.05], [0.01, 0.05], [0.03, 0.03]])
    sensor = Sensor(rectangle_m((0.06, 0.06)), 18e3, 10.0, center, np.full((5, 2), 4e-3))
    frames = None if history is None or voltage is None else Frames(voltage, history)
    return Recording("test", "2026-01-01T00:00:00", "", sensor, protocol, frames, None, None, None)


def test_recording_without_anything_can_not_tell() -> None:
    found = diagnose_any(recording(None, None), "empty.h5", silent).diagnosis
    assert found.verdict == "cannot_tell"
    assert found.reason


def test_one_corner_press_slightly_off_is_no_mismatch_but_a_torn_place_is() -> None:
    press = np.repeat(np.arange(6), 10)
    residual = np.random.default_rng(5).standard_normal((60, 276))
    slightly, torn = residual.copy(), residual.copy()
    slightly[press == 5] *= 1.5
    torn[press == 5] *= 4.0
    assert broad_ratio(slightly, press) < 1.02
    assert broad_ratio(torn, press) > 1.5


def test_claims_of_many_electrodes_are_one_line_for_a_reader() -> None:
    loose = [Claim(ContactDrift(k), 0.85, 1.2, {}) for k in (3, 7)]
    gain = Claim(ChannelGain(5, gain=0.01), 0.9, 1.5, {"gain": Estimate(0.01, 0.0, 0.02, "1")})
    names = [name for _, name in gathered((gain, *loose))]
    assert names == ["channel_gain (channel 5)", "contact_drift (electrodes 3, 7)"]
