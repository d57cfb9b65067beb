"""Every effect and family of the generator: none of it at size 0, something the noise doesn't hide at a stated size."""

from __future__ import annotations

import json
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path

import numpy as np
import own_ratios
import pytest
from generator.effect import Effect
from generator.families import FAMILIES, FIRST, SECOND, THIRD
from generator.forms import FORMS
from generator.mesh import Fineness
from generator.outline import Outline
from generator.protocol import Plan
from generator.recording import Clean, clean, measured
from generator.sheet import Electrodes, Sheet
from generator.simulate import Transfers, frames_of, moments_of
from generator.skins import _sheet
from generator.strength import Ruler
from small_proof_skin import small_skin
from suite import BATCHES, SPLIT, draw_split, families, whole_split

NAMES = [
    "nonlinear_foam", "viscoelastic_foam", "foam_hysteresis", "foam_softening", "indenter_offset",
    "piezo_hysteresis", "piezo_creep", "piezo_inhomogeneity", "sheet_anisotropy", "sheet_inhomogeneity",
    "temperature_drift", "contact_pressure_dependence", "electrode_displacement", "channel_gain", "crosstalk",
    "adc_saturation", "scan_skew", "contact_drift", "self_heating",
]  # fmt: skip
"""The table of names: a contract of the project's."""
RESULTS = Path(__file__).parents[2] / "experiments" / "concealed" / "results"
KINDS = [*(kind for kinds in FORMS.values() for kind in kinds), *FAMILIES.values()]


@cache
def without() -> tuple[Sheet, Clean]:
    skin = small_skin()
    sheet = Sheet(skin.outline_m, skin.electrodes, skin.fineness)
    return sheet, clean(skin, [], sheet)


def change(effects: list[Effect]) -> tuple[float, float]:
    """rms of what effects change: readings over the reading noise, force over the load cell's."""
    skin, (sheet, base) = small_skin(), without()
    for effect in effects:
        effect.draw(skin, np.random.default_rng(3))
    found = clean(skin, effects, sheet)
    voltage, moving = found.voltage_v, np.arange(len(found.voltage_v)) % 2 == 0
    for effect in effects:
        voltage = effect.recorded(voltage, moving, np.random.default_rng(5))
    step = (voltage - base.voltage_v) / skin.noise.white_v
    force = (found.force_n - base.force_n) / skin.noise.force_n
    return float(np.sqrt(np.mean(step**2))), float(np.sqrt(np.mean(force**2)))


def test_all_effects_at_size_nothing_are_nothing() -> None:
    one_form_each = [kinds[-1] for kinds in FORMS.values()] + list(FAMILIES.values())
    assert max(change([kind(0.0) for kind in one_form_each])) < 1e-3


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.name}-{kind.form}")
def test_an_effect_at_half_its_largest_size_is_beyond_the_noise(kind: type[Effect]) -> None:
    assert max(change([kind(0.5 * kind.largest)])) > 1.0


@pytest.mark.parametrize("kind", [*SECOND.values(), *THIRD.values()], ids=lambda kind: kind.name)
def test_a_family_draws_the_same_whatever_its_size_and_runs_the_same_again(kind: type[Effect]) -> None:
    skin, (sheet, _) = small_skin(), without()
    one, other, larger = (kind(share * kind.largest) for share in (0.3, 0.3, 0.9))
    for effect in (one, other, larger):
        effect.draw(skin, np.random.default_rng(3))
    assert larger.details == one.details
    first, again, fresh = (clean(skin, [effect], sheet, [2, 5, 9]) for effect in (one, one, other))
    for found in (again, fresh):
        np.testing.assert_array_equal(found.voltage_v, first.voltage_v)
        np.testing.assert_array_equal(found.force_n, first.force_n)
    assert np.isfinite(first.voltage_v).all()
    assert np.isfinite(first.force_n).all()


@pytest.mark.parametrize(
    "kind", [kind for kind in THIRD.values() if kind.recorded is not Effect.recorded], ids=lambda kind: kind.name
)
def test_what_scans_bear_on_one_another_comes_out_the_same_again(kind: type[Effect]) -> None:
    skin, (_, base) = small_skin(), without()
    moving = np.zeros(len(base.voltage_v), dtype=bool)
    none, one, other = (kind(share * kind.largest) for share in (0.0, 0.3, 0.3))
    for effect in (none, one, other):
        effect.draw(skin, np.random.default_rng(3))
    left, first, again = (e.recorded(base.voltage_v, moving, np.random.default_rng(5)) for e in (none, one, other))
    np.testing.assert_allclose(left, base.voltage_v, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(again, first)
    assert np.isfinite(first).all()
    assert np.abs(first - base.voltage_v).max() > skin.noise.white_v


def test_forms_cover_every_name_and_say_where_they_come_from() -> None:
    assert set(NAMES) == set(FORMS)
    assert all(kind.source and kind.form for kind in KINDS)
    for name, kinds in FORMS.items():
        assert len({kind.form for kind in kinds}) == len(kinds) >= 2
        assert {kind.name for kind in kinds} == {name}


def test_the_split_of_families_is_the_committed_draws() -> None:
    drawn = whole_split()
    committed = json.loads(SPLIT.read_text())
    assert {half: committed[half] for half in drawn} == drawn
    assert sorted(drawn["open"] + drawn["sealed"]) == sorted(FAMILIES)
    assert set(drawn["open"]) <= set(families(final=False))
    assert set(families(final=True)) <= set(drawn["sealed"])
    assert not set(families(final=False)) & set(families(final=True))


def test_a_batch_of_families_is_halved_by_its_own_draw() -> None:
    first, second, third = (draw_split(seed) for seed in BATCHES)
    for drawn, batch in ((first, FIRST), (second, SECOND), (third, THIRD)):
        assert set(drawn["open"] + drawn["sealed"]) == set(batch)
        assert len(drawn["open"]) == len(drawn["sealed"]) == len(batch) / 2
    assert (len(FIRST), len(SECOND), len(THIRD), len(FAMILIES)) == (26, 30, 30, 86)
    assert not set(FAMILIES) & set(FORMS)
    # What earlier draws sealed was opened by last runs of a seed: a later batch must not move it.
    spent = json.loads(SPLIT.read_text())["spent"]
    assert (first["sealed"], second["sealed"]) == (spent["final310"], spent["final314"])


def test_a_ruler_finds_the_size_of_the_ratio_wanted() -> None:
    skin = small_skin()
    ruler = Ruler(skin)

    def make(size: float) -> Effect:
        effect = FORMS["piezo_creep"][0](size)
        effect.draw(skin, np.random.default_rng(1))
        return effect

    size, reached = ruler.size(make, 1.5)
    assert reached.own == pytest.approx(1.5, abs=0.05)
    assert ruler.ratio([make(2 * size)]).own > 1.9
    assert ruler.ratio([make(0.0)]).own == pytest.approx(1.0, abs=1e-6)


def test_contacts_that_all_change_alike_are_no_effect_to_the_ruler() -> None:
    skin = small_skin()

    class Lead(Effect):
        def network(self, transfer_ohm, moment):  # type: ignore[no-untyped-def]
            return transfer_ohm + 30.0 * np.eye(len(transfer_ohm))

    assert Ruler(skin).ratio([Lead(1.0)]).own == pytest.approx(1.0, abs=1e-3)


def test_a_ruler_knows_force_as_the_whole_plan_has_it() -> None:
    # More presses than the ruler reads, in more levels: the stage moves on by a share of a step, not of a press.
    skin = small_skin()
    presses = tuple(replace(press, depth_m=3.75e-4 * np.arange(1, 9)) for press in 2 * skin.plan.presses)
    skin = replace(skin, plan=Plan(presses))
    effect = FORMS["scan_skew"][0](0.15)
    effect.draw(skin, np.random.default_rng(1))
    linear, true = (clean(skin, effects, without()[0], [0]).force_n.ravel() for effects in ([], [effect]))
    linear, true = linear[linear > 0], true[linear > 0]
    left = true - linear * (true @ linear) / (linear @ linear)
    expected = np.sqrt(1.0 + np.mean(left**2) / skin.noise.force_n**2)
    assert 1.1 < expected < 2.0
    assert Ruler(skin).ratio([effect]).force == pytest.approx(expected, rel=0.1)


def test_the_ruler_measures_what_the_last_sample_was_sealed_with() -> None:
    case, _, sealed, now = next(own_ratios.measured(RESULTS / "eighth32", "scan_skew"))
    assert case == "c001"
    assert astuple(now) == pytest.approx(astuple(sealed), abs=0.005)


def test_frames_that_are_chosen_are_read_as_in_the_whole_recording() -> None:
    skin, (sheet, _) = small_skin(), without()
    effects = [FORMS[name][0](0.3) for name in ("piezo_creep", "foam_softening", "scan_skew")]
    for effect in effects:
        effect.draw(skin, np.random.default_rng(3))
    whole, chosen = clean(skin, effects, sheet), [0, 6, 11, 15]
    some = clean(skin, effects, sheet, chosen)
    np.testing.assert_allclose(some.voltage_v, whole.voltage_v[chosen], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(some.force_n, whole.force_n)


def test_a_recording_has_its_noise_and_only_that() -> None:
    skin, (_, base) = small_skin(), without()
    data = measured(skin, [], [], base)
    left = data.voltage_v - base.voltage_v
    assert left.std() == pytest.approx(skin.noise.white_v, rel=0.05)
    assert (data.force_n - base.force_n).std() == pytest.approx(skin.noise.force_n, rel=0.3)
    again = measured(skin, [], [], base)
    np.testing.assert_array_equal(data.voltage_v, again.voltage_v)


def test_a_sheet_that_warms_while_it_is_pressed_is_solved_as_it_is_then() -> None:
    skin, (sheet, _) = small_skin(), without()
    effects = [kind(0.5 * kind.largest) for kind in FORMS["self_heating"][:1]]
    for effect in effects:
        effect.draw(skin, np.random.default_rng(3))
    moments = moments_of(skin, frames_of(skin))[:8]
    found, _ = Transfers(skin, effects, sheet).run(moments)
    stepped = Transfers(skin, effects, sheet)
    forces, secants = stepped.mechanics.forces(moments)
    stepped.fabric.electric(replace(moments[0], since_s=0.0), np.zeros(len(stepped.fabric.point_m)))
    states = [(m.frame, stepped._electric(m, *now)) for m, *now in zip(moments, forces, secants, strict=True)]
    whole = {frame: sheet.transfer(*electric) for frame, electric in states}
    assert sum(len(force) > 0 for force in forces) >= 2
    for moment, transfer in found:
        np.testing.assert_allclose(transfer, whole[moment.frame], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", FORMS["self_heating"], ids=lambda kind: kind.form)
def test_scans_warm_the_sheet_by_what_is_left_of_their_heat(kind: type[Effect]) -> None:
    skin, effect, none = small_skin(), kind(0.1), kind(0.0)
    for one in (effect, none):
        one.draw(skin, np.random.default_rng(3))
    assert none.meaning(skin) == {"warmed_300_s": 0.0}
    # Most of the plan's frames are half a second apart: 601 scans, and a grid of half millimetres for the area.
    tau = np.array(effect.tau_s)  # type: ignore[attr-defined]
    scans_hz = np.mean(-np.expm1(-601 * 0.5 / tau) / (-np.expm1(-0.5 / tau) * tau))
    middle = 5e-4 * (np.arange(120) + 0.5)
    grid = np.stack([a.ravel() for a in np.meshgrid(middle, middle)], axis=1)
    expected = np.mean(np.exp(-0.1 * scans_hz * effect.heat(grid)) - 1.0)  # type: ignore[attr-defined]
    assert effect.meaning(skin)["warmed_300_s"] == pytest.approx(expected, rel=5e-3)
    assert -0.2 < expected < -0.15


@pytest.mark.parametrize("kind", FORMS["electrode_displacement"], ids=lambda kind: kind.form)
@pytest.mark.parametrize("shape", ["round16", "round32"])
def test_an_electrode_of_the_rim_slides_as_a_whole_and_keeps_its_length(shape: str, kind: type[Effect]) -> None:
    outline, drawn, _ = _sheet(shape)
    skin, effect, round_m = replace(small_skin(), outline_m=outline, electrodes=drawn), kind(1.0), Outline(outline)
    effect.draw(skin, np.random.default_rng(3))
    slid = effect.electrodes(drawn)
    sheet = Sheet(outline, slid, Fineness(8e-3, 4e-3, 8e-4))
    np.testing.assert_allclose(np.bincount(sheet.edge_owner, sheet.edge_weight.sum(axis=1)), drawn.extent, rtol=1e-9)
    assert slid.edge_m is not None
    assert drawn.edge_m is not None
    ways = [round_m.way(edge.reshape(-1, 2)).reshape(-1, 2) for edge in (drawn.edge_m, slid.edge_m)]
    moved = (ways[1] - ways[0] + 0.5 * round_m.length_m) % round_m.length_m - 0.5 * round_m.length_m
    np.testing.assert_allclose(moved[:, 0], moved[:, 1], atol=1e-12)
    number = effect.details["electrode"]
    assert np.argmax(np.abs(moved[:, 0])) == number
    assert np.flatnonzero(np.abs(moved[:, 0]) > 1e-6).tolist() == effect.details.get("electrodes", [number])
    dx, dy = (slid.edge_m - drawn.edge_m)[number].mean(axis=0)
    assert effect.meaning(skin) == pytest.approx({"dx_m": dx, "dy_m": dy})


def test_an_electrode_off_the_outline_or_on_another_is_refused() -> None:
    outline, drawn, _ = _sheet("round16")
    assert drawn.edge_m is not None
    with pytest.raises(ValueError, match="doesn't lie on the outline"):
        Sheet(outline, Electrodes(edge_m=drawn.edge_m + 1e-4))
    with pytest.raises(ValueError, match="overlap"):
        Sheet(outline, Electrodes(edge_m=drawn.edge_m[[0, 0]]), Fineness(8e-3, 4e-3, 8e-4))
