"""Networks, yardsticks and bound on the same frames: fed what they read, scored by the same truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import resistor_sheet
from torch import Tensor

from ertskin.data.discrepancy import Discrepancy
from ertskin.data.touches import Touches
from ertskin.errors import UserError
from ertskin.evaluation.benchmark import Lesson, TestFrames, network_result, yardstick_result
from ertskin.evaluation.corrected_forward import CorrectedForward
from ertskin.evaluation.panel import YARDSTICKS, yardsticks
from ertskin.evaluation.trained import grouped, on_grid, without_and_with
from ertskin.evaluation.yardsticks import Ridge
from ertskin.models.estimate import Estimate
from ertskin.models.network import Network
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.history import History

TAXEL_M = resistor_sheet.taxel_m()
PROTOCOL = resistor_sheet.protocol()


class Sheet:
    """The resistor sheet as a forward model."""

    def change_ohm(self, contact_m: np.ndarray, force_n: np.ndarray) -> np.ndarray:
        return resistor_sheet.change_ohm(contact_m, force_n)


class Echo(Network):
    """Says its inputs' first readings as forces: shows what it was fed."""

    def __init__(self, reads: str):
        super().__init__()
        self.reads = reads  # type: ignore[misc]
        self.register_buffer("taxel_m", Tensor(TAXEL_M))

    def estimate(self, change_v: Tensor) -> Estimate:
        said = change_v[:, :9].double().numpy()
        return Estimate(said, said > 0)


def touches(count: int, contacts: int, seed: int) -> Touches:
    trials = resistor_sheet.trials(count, contacts, seed)
    change_v = trials.coordinates_v(PROTOCOL)
    frames = np.arange(count)
    history = History(
        frames * 1.0, frames, np.ones(count, np.uint8), trials.contact_m, 0 * trials.force_n, trials.force_n
    )
    raw_v = trials.readings_v(PROTOCOL) + 1.0  # marked, to be told from the coordinates
    rest_v = np.zeros((1, *PROTOCOL.shape))
    return Touches(PROTOCOL, change_v, raw_v.astype(np.float32), history, rest_v, np.zeros((1, 1)), np.zeros(count))


@pytest.fixture(scope="module")
def frames() -> TestFrames:
    return TestFrames.of([touches(60, 1, 5), touches(40, 2, 6)], TAXEL_M, 0.01)


def test_recordings_with_one_and_two_contacts_join(frames):
    assert frames.contact_m.shape == (100, 2, 2)
    np.testing.assert_array_equal((frames.true_map_n > 0).sum(axis=1), [1] * 60 + [2] * 40)
    assert np.isnan(frames.contact_m[:60, 1]).all()


def test_contacts_off_the_grid_are_refused():
    with pytest.raises(UserError, match="choose the recording's grid"):
        TestFrames.of([touches(5, 1, 5)], resistor_sheet.taxel_m(2), 0.001)


@pytest.mark.parametrize(("reads", "fed"), [("coordinates", "change_v"), ("readings", "readings_v")])
def test_a_network_is_fed_what_it_reads(frames, reads, fed):
    result = network_result(
        "echo", {3: Reconstruction(PROTOCOL, Echo(reads), None, {"run_id": "abc"})}, lambda trained: frames
    )
    expected = getattr(frames, fed)[:, :9].astype(np.float32)
    np.testing.assert_array_equal(result.runs[0].outcome.map_n, expected)
    assert (result.kind, result.runs[0].seed, result.runs[0].run_id) == ("network", 3, "abc")


def test_a_lesson_keeps_its_threshold_rows_apart():
    lesson = Lesson.of(resistor_sheet.material(None, 300), seed=0)
    assert (len(lesson.change_v), len(lesson.held_out_v)) == (255, 45)
    assert not (lesson.change_v[:, None] == lesson.held_out_v).all(axis=-1).any()


def test_yardsticks_get_a_result_per_seed(frames):
    material = resistor_sheet.material(None, 600)
    result = yardstick_result(lambda seed: Ridge(), {seed: Lesson.of(material, seed) for seed in (0, 1)}, frames)
    assert [run.seed for run in result.runs] == [0, 1]
    assert len(set(result.values("force_rmse_one_n"))) == 2


def test_the_whole_panel_is_ordered_as_it_should_be(frames):
    material = resistor_sheet.material(None, 900)
    rng = np.random.default_rng(0)
    noisy_v = frames.change_v + material.noise.coordinates(rng, len(frames.change_v))
    noisy = replace(frames, change_v=noisy_v)

    def no_sheet():
        raise AssertionError("only imaging asks for the sheet")

    names = [name for name in YARDSTICKS if name != "imaging"]
    results = {r.name: r for r in yardsticks(names, material, Sheet(), no_sheet, noisy, [0])}
    rmse = {name: r.values("force_rmse_one_n").mean() for name, r in results.items()}
    assert rmse["oracle"] == pytest.approx(rmse["Cramér-Rao bound"], rel=0.35)  # 60 frames, few of them weigh
    assert rmse["oracle"] < 0.5 * rmse["kernel ridge"]
    assert rmse["kernel ridge"] < rmse["ridge"] < rmse["mean"]
    assert results["oracle"].values("hit_rate_one")[0] == 1.0
    assert results["oracle"].values("exact_rate_two")[0] >= 0.95
    assert results["mean"].values("hit_rate_one")[0] == 0.0


def test_an_unknown_yardstick_is_refused(frames):
    with pytest.raises(UserError, match="no yardstick named crystal ball"):
        yardsticks(["crystal ball"], resistor_sheet.material(None, 60), Sheet(), lambda: None, frames, [0])


def test_the_corrected_forward_adds_the_discrepancy():
    places, forces = np.repeat(TAXEL_M[:1], 8, axis=0), np.linspace(1, 8, 8)
    beyond_v = 0.01 * np.log1p(forces)[:, None] * np.ones(28)
    found = Discrepancy.fit(places, forces, beyond_v, beyond_v, 1e-8 * np.eye(28), 0.01)
    corrected = CorrectedForward(Sheet(), found, PROTOCOL)
    contact_m, force_n = places[3:4, None], forces[3:4, None]
    added = PROTOCOL.whitened(corrected.change_ohm(contact_m, force_n) - Sheet().change_ohm(contact_m, force_n))
    np.testing.assert_allclose(added[0], beyond_v[3], rtol=0.02)


def trained(
    name: str, seed: int, noise: str = "white", grid: int = 3, effects: dict[str, dict[str, float]] | None = None
) -> Reconstruction:
    network = Echo("coordinates")
    network.taxel_m = Tensor(resistor_sheet.taxel_m(grid))
    config = {"model": {"name": name}, "seed": seed, "noise": noise, "effects": effects or {}}
    return Reconstruction(PROTOCOL, network, None, {"config": config})


def test_models_are_grouped_by_what_differs_besides_the_seed():
    models = [trained("a", 0), trained("a", 1), trained("b", 0, "white"), trained("b", 0, "measured")]
    groups = grouped(models)
    assert {name: sorted(seeds) for name, seeds in groups.items()} == {
        "a": [0, 1],
        "b (noise white)": [0],
        "b (noise measured)": [0],
    }


def test_trainings_with_the_same_effects_and_other_parameters_stand_apart():
    amounts = [{"loop": {"width": 0.1, "decay": 2.0}}, {"loop": {"width": 0.2, "decay": 2.0}}, {"drift": {"rate": 0.1}}]
    groups = grouped([trained("a", 0, effects=effects) for effects in [None, *amounts]])
    assert set(groups) == {"a", "a (with loop, loop.width 0.1)", "a (with loop, loop.width 0.2)", "a (with drift)"}
    assert without_and_with(groups) == [("a", name) for name in groups if name != "a"]


def test_models_of_another_grid_are_left_out():
    group = {0: trained("a", 0), 1: trained("a", 1, grid=2)}
    assert on_grid(group, TAXEL_M) == {0: group[0]}
