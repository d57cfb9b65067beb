"""A whole skin diagnosed: recordings by the bench, whose physics shares nothing with the model's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from omegaconf import OmegaConf
from small_bench import twelve_presses

from ertskin.calibration.fit import fit_recording
from ertskin.calibration.store import load_calibration, save_calibration
from ertskin.cores import SHARE_VARIABLE
from ertskin.data.chosen_presses import made_presses, presses_of
from ertskin.data.simulated import correcting
from ertskin.data.skin_forward import SkinForward
from ertskin.data.sources import CALIBRATION, calibration_folder, calibration_path
from ertskin.data.touches import touches_of
from ertskin.diagnosis import skin
from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.contract.claims import Claim, Diagnosis, FieldMap, HeldOut
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.judge.confidence import UNKNOWN_MAPS
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.output.joint_calibration import joint_calibration, write_joint_calibration
from ertskin.diagnosis.recording.work import Work
from ertskin.diagnosis.search.chosen import Selection
from ertskin.hardware.recording import Recording, read_recording
from ertskin.hardware.virtual.bench import FAST, write_bench
from ertskin.hardware.virtual.bench.truth import Truth
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity
from ertskin.physics.effects.registry import effects_config
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity

pytestmark = pytest.mark.long


def diagnosed(recording: Recording, criteria: Criteria = DEFAULT) -> Findings:
    return diagnose_any(recording, "hidden.h5", lambda share, text: None, "fast", criteria=criteria)


def diagnosed_at_full_size(path: Path, hidden: dict[str, float], seed: int) -> tuple[Diagnosis, Truth]:
    """What is found on the paper's skin, and what is hidden in it."""
    truth = write_bench(path, "quick", hidden, seed=seed, resolution=FAST)
    return diagnosed(read_recording(path)).diagnosis, truth


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Findings]:
    """A recording with a loop, and what is found on it."""
    path = tmp_path_factory.mktemp("loop") / "hidden.h5"
    write_bench(path, "quick", {"piezo_hysteresis": 1.0}, seed=6, resolution=FAST)
    return path, diagnosed(read_recording(path))


@pytest.mark.timeout(300)
def test_nothing_is_named_where_nothing_was_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SHARE_VARIABLE, "2")
    recording, _ = twelve_presses({}, seed=5)
    found = diagnosed(recording).diagnosis
    assert found.verdict == "no_mismatch"
    assert not found.claims
    assert found.held_out.ratio_before == pytest.approx(1.0, abs=0.05)


@pytest.mark.timeout(300)
def test_the_calibration_fitted_with_the_effects_is_the_one_that_is_simulated_with_them(
    tmp_path: Path, loop: tuple[Path, Findings]
) -> None:
    path, found = loop
    recording = read_recording(path)
    assert [claim.effect.name for claim in found.diagnosis.claims] == ["piezo_hysteresis"]
    own, _ = fit_recording(recording, path.name, resolution="fast")
    save_calibration(calibration_folder(tmp_path, path) / CALIBRATION, own)
    written = write_joint_calibration(tmp_path, path, found)
    effects = effects_config(found.diagnosis.effects)
    given = {"calibration": {"file": None, "folder": str(tmp_path)}, "recording": str(path), "effects": effects}
    assert calibration_path(OmegaConf.create(given)) == written
    other = {"piezo_hysteresis": effects["piezo_hysteresis"] | {"width": 0.5}}
    assert calibration_path(OmegaConf.create(given | {"effects": other})).name == CALIBRATION
    touches = correcting(touches_of(recording))
    misfits = []
    for calibration in (own, load_calibration(written)):
        forward = SkinForward(calibration, touches.protocol, effects, "fast")
        change = forward.change_ohm(touches.history.contact_m, touches.history.force_n)
        misfits.append(np.std(touches.protocol.whitened(change) - touches.change_v))
    assert own.noise_v is not None
    excess = np.array(misfits) ** 2 - own.noise_v**2
    assert excess[1] < 0.5 * excess[0]


def test_of_few_presses_what_all_of_them_show_is_handed_on(loop: tuple[Path, Findings]) -> None:
    handed_on_of_all_presses(loop[1], chosen_from_all=False)


@pytest.mark.timeout(300)
def test_of_very_few_presses_effects_are_chosen_from_all_and_maps_judged_last(monkeypatch: pytest.MonkeyPatch) -> None:
    judged, judge = list[Findings](), skin._with_maps_judged
    monkeypatch.setattr(skin, "none_is_known", lambda claims: True)
    monkeypatch.setattr(skin, "_with_maps_judged", lambda found: judged.append(found) or judge(found))
    whole, _ = twelve_presses({"piezo_hysteresis": 1.0}, seed=6)
    assert whole.frames is not None
    few = presses_of(whole, made_presses(whole.frames)[::2].tolist())
    found = diagnosed(few)
    handed_on_of_all_presses(found, chosen_from_all=True)
    assert found.diagnosis.verdict == "partly_explained"
    assert UNKNOWN_MAPS in str(found.diagnosis.reason)
    assert [(one.whole, one.diagnosis.claims) for one in judged] == [(found.whole, found.diagnosis.claims)]


def of_map(right: float | None) -> Claim:
    """A field of the sheet with how likely its map is right; None of one whose name stands for its map."""
    map_of = FieldMap(np.zeros((1, 2)), np.zeros(1), right=right)
    return Claim(SheetInhomogeneity(), 0.95, 2.0, {}, field_map=map_of)


@pytest.mark.parametrize(
    ("claims", "known"),
    [
        ((of_map(0.49),), False),
        ((of_map(0.49), of_map(0.1)), False),
        ((of_map(0.5),), True),
        ((of_map(None),), True),
        ((of_map(0.49), of_map(0.5)), True),
        ((of_map(0.49), Claim(AdcSaturation(limit_v=5.0), 0.95, 2.0, {})), True),
        ((), True),
    ],
)
def test_fields_of_unknown_maps_alone_explain_in_part(claims: tuple[Claim, ...], known: bool) -> None:
    for verdict in ("explained", "partly_explained"):
        found = Findings(Diagnosis("some.h5", verdict, HeldOut("split", 1e-3, 3.0, 1.0, 0.0), claims=claims))
        judged = skin._with_maps_judged(found).diagnosis
        assert judged.verdict == ("explained" if known and verdict == "explained" else "partly_explained")
        assert (judged.reason == UNKNOWN_MAPS) == (verdict == "explained" and not known)


def handed_on_of_all_presses(found: Findings, *, chosen_from_all: bool) -> None:
    """What all presses show is handed on: the effects chosen from them anew, or those found fitted to all."""
    assert found.whole is not None
    assert found.selection is not None
    assert "piezo_hysteresis" in [effect.name for effect in found.diagnosis.effects]
    presses = [np.unique(each.problem.evidence.history.press) for each in (found.selection, found.whole)]
    assert len(presses[0]) < len(presses[1])
    calibration = joint_calibration(found)
    assert calibration is not None
    np.testing.assert_array_equal(calibration.contact_resistance_ohm, found.whole.after.calibration.contact_ohm)
    assert (found.whole.chosen is found.selection.chosen) == (not chosen_from_all)
    assert found.diagnosis.as_builtins()["of_all_presses"] == [effect.name for effect in found.diagnosis.effects]


@dataclass(frozen=True)
class Counted:
    """Evidence, as far as work is counted."""

    work: Work


@pytest.mark.parametrize(
    ("verdict", "ended", "says"),
    [
        ("unexplained", False, False),
        ("unexplained", True, True),
        ("explained", True, True),
        ("no_mismatch", True, False),
    ],
)
def test_a_search_cut_short_says_so_where_something_is_missing(verdict: str, ended: bool, says: bool) -> None:
    found = Findings(Diagnosis("some.h5", verdict, HeldOut("split", 1e-3, 3.0, 3.0, 0.0), reason="something"))
    once = skin._with_its_end(found, Work(has_ended=ended))
    said = once.diagnosis.reason
    assert said is not None
    assert skin._with_its_end(once, Work(has_ended=ended)).diagnosis.reason == said
    assert said.startswith("something; the search stopped") == says
    assert (said == "something") == (not says)


def test_linearising_counts_as_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skin, "LinearSkin", lambda *given: SimpleNamespace(derivatives=7))
    monkeypatch.setattr(skin, "VoltageProblem", lambda *given, about: given)
    history, rows = SimpleNamespace(press=np.arange(12)), np.arange(12)
    evidence: Any = SimpleNamespace(work=Work(5.0), history=history, frames=lambda rows: None)
    given: Any = (evidence, SimpleNamespace(specimen=None), None, None, None, rows, lambda share, text: None)
    skin._problem(*given)
    assert evidence.work.done == 12.0


def test_few_presses_that_can_not_be_fitted_together_hand_on_what_was_claimed() -> None:
    claimed = Findings(Diagnosis("six.h5", "explained", HeldOut("split", 1e-3, 3.0, 1.0, 0.0), reason="something"))

    def choose() -> Selection:
        raise MeshError("no such sheet")

    found = skin._handing_on(claimed, choose, anew=False)
    assert found.whole is None
    assert found.diagnosis.of_all_presses is None
    assert found.diagnosis.reason == (
        "something; all presses can't be fitted together: what is handed on comes from those not held out"
    )


@pytest.mark.parametrize(
    ("presses", "effects", "field", "spoilt", "by_place", "way"),
    [
        (11, 1, False, False, False, "chosen"),
        (11, 0, False, False, False, "chosen"),
        (11, 1, True, True, False, "as found"),
        (11, 1, True, True, True, "chosen"),
        (12, 1, False, False, False, "fitted"),
        (12, 1, True, False, False, "fitted"),
        (12, 0, False, False, False, "as found"),
        (12, 1, False, True, False, "as found"),
        (24, 1, True, False, False, "as found"),
    ],
)
def test_what_is_handed_on_is_chosen_or_fitted_by_how_many_presses_there_are(
    monkeypatch, presses: int, effects: int, field: bool, spoilt: bool, by_place: bool, way: str
) -> None:
    monkeypatch.setattr(skin, "all_fitted", lambda evidence: (np.arange(3), presses))

    def selected(*given: object) -> str:
        # What it begins with: how far a field spreads is chosen anew.
        assert len(given[-1]) == (0 if field else 1)  # type: ignore[arg-type]
        return "chosen"

    monkeypatch.setattr(skin, "_selected", selected)
    monkeypatch.setattr(skin, "_fitted_to", lambda *_: "fitted")
    monkeypatch.setattr(skin, "_handing_on", lambda findings, choose, anew: choose())
    monkeypatch.setattr(skin, "with_fields_of_all_presses", lambda whole, family: whole)
    claims = (Claim(PiezoInhomogeneity(amplitude=0.1), 0.9, 2.0, {}, by_place=by_place),)
    found = Findings(Diagnosis("some.h5", "explained", HeldOut("split", 1e-3, 3.0, 1.0, 0.0), claims=claims))
    found = replace(found, diagnosis=replace(found.diagnosis, spoilt=spoilt))
    terms = [SimpleNamespace(modes=np.eye(2) if field else None)]
    begun = [(term, SimpleNamespace(rivals=())) for term in terms]
    selection = SimpleNamespace(after=SimpleNamespace(effects=("one",) * effects, terms=terms), found=begun)
    asked = (found, Counted(Work()), None, None, selection)
    handed = skin._for_simulation(*asked, skin.select, lambda share, text: None)  # type: ignore[arg-type]
    assert (handed if isinstance(handed, str) else "as found") == way
    if way == "fitted" and field:
        # Another way to choose chooses again: how far a field spreads is its own affair.
        assert skin._for_simulation(*asked, selected, lambda share, text: None) == "chosen"  # type: ignore[arg-type, comparison-overlap]
    if way == "chosen":
        # A search that was cut short isn't made again.
        cut = (found, Counted(Work(has_ended=True)), None, None, selection)
        assert skin._for_simulation(*cut, skin.select, lambda share, text: None) == "fitted"  # type: ignore[arg-type, comparison-overlap]


def test_what_is_fitted_to_all_presses_counts_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skin, "all_fitted", lambda evidence: (np.arange(3), 12))
    monkeypatch.setattr(skin, "_fitted_to", lambda rows, evidence, *_: evidence.work)
    monkeypatch.setattr(skin, "_handing_on", lambda findings, choose, anew: choose())
    monkeypatch.setattr(skin, "_with_its_end", lambda findings, work: findings)
    monkeypatch.setattr(skin, "with_fields_of_all_presses", lambda whole, family: whole)
    found = Findings(Diagnosis("some.h5", "explained", HeldOut("split", 1e-3, 3.0, 1.0, 0.0)))
    selection = SimpleNamespace(after=SimpleNamespace(effects=("one",), terms=[]), found=[])
    asked = (found, Counted(Work(2e9, has_ended=True)), None, None, selection, skin.select, lambda share, text: None)
    work: Any = skin._for_simulation(*asked)  # type: ignore[arg-type]
    assert (work.done, work.has_ended) == (0.0, False)


@pytest.mark.parametrize("saturated_v", [None, 2.0])
def test_a_limit_is_handed_on_once_whether_it_was_fitted_or_measured(saturated_v: float | None) -> None:
    limit = AdcSaturation(compression=0.1) if saturated_v is None else AdcSaturation(limit_v=saturated_v)
    claims = (Claim(limit, 0.9, 2.0, {}),)
    found = Findings(Diagnosis("some.h5", "explained", HeldOut("split", 1e-3, 3.0, 1.0, 0.0), claims=claims))
    found = replace(found, evidence=SimpleNamespace(saturated_v=saturated_v))  # type: ignore[arg-type]
    fitted = () if saturated_v is not None else (limit,)
    whole = SimpleNamespace(chosen=(), after=SimpleNamespace(effects=fitted))
    assert skin._handing_on(found, lambda: whole, anew=False).diagnosis.of_all_presses == (limit,)  # type: ignore[arg-type, return-value]


def named_and_predicting(found: Diagnosis, name: str) -> None:
    """The effect is named first and surely, and predicts the presses held out."""
    assert found.claims[0].effect.name == name
    assert found.claims[0].confidence > 0.8
    before, after = found.held_out.ratio_before, found.held_out.ratio_after
    assert before is not None
    assert after is not None
    assert before > 1.2
    assert after < 1 + 0.2 * (before - 1)


@pytest.mark.timeout(300)
def test_what_was_left_out_is_named_and_predicts_where_the_criteria_let_it() -> None:
    recording, _ = twelve_presses({"crosstalk": 1.0}, seed=6)
    named_and_predicting(diagnosed(recording).diagnosis, "crosstalk")
    found = diagnosed(recording, Criteria(significant_gain=1e9)).diagnosis
    assert found.verdict == "unexplained"
    assert not found.claims


@pytest.mark.timeout(300)
def test_an_amplifier_that_bends_softly_is_named_alone_and_predicts() -> None:
    """Of eight channels only four readings are bent by more than noise: too few, once, for more than a limit."""
    recording, _ = twelve_presses({}, seed=11)
    assert recording.frames is not None
    straight_v = np.array(recording.frames.voltage_v)
    scale_v = 5.0 * float(straight_v.max())
    bent = replace(recording, frames=replace(recording.frames, voltage_v=scale_v * np.tanh(straight_v / scale_v)))
    found = diagnosed(bent).diagnosis
    named_and_predicting(found, "adc_saturation")
    (claim,) = found.claims
    assert claim.parameters["compression"].value == pytest.approx(1 / 75, rel=0.05)


@pytest.mark.timeout(300)
def test_a_sheet_warmed_by_the_scan_is_known_by_how_much_and_how_fast(tmp_path: Path) -> None:
    """The bench's readings rise by a share of their own; the model's sheet by the power of the injections before."""
    found, truth = diagnosed_at_full_size(tmp_path / "hidden.h5", {"self_heating": 1.0}, seed=6)
    named_and_predicting(found, "self_heating")
    (claim,) = found.claims
    warmed = truth.parameters("self_heating")
    assert claim.parameters["rise"].value == pytest.approx(warmed["share"], rel=0.05)
    assert claim.parameters["settle_scans"].value == pytest.approx(warmed["settle_scans"], rel=0.05)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("name", "key", "words", "stage"),
    [
        ("frozen_channel", "channel", "repeats", "acquisition"),
        ("intermittent_electrode", "electrode", "loose", "electrodes"),
    ],
)
def test_what_has_no_name_is_said_with_its_place(tmp_path: Path, name: str, key: str, words: str, stage: str) -> None:
    found, truth = diagnosed_at_full_size(tmp_path / "hidden.h5", {name: 2.0}, seed=7)
    assert found.verdict == "unexplained"
    assert not found.claims
    assert found.electrodes == (truth.parameters(name)[key],)
    assert found.stage == stage
    assert words in (found.reason or "")


@pytest.mark.timeout(300)
def test_a_loose_contact_is_said_beside_what_is_named() -> None:
    recording, truth = twelve_presses({"intermittent_electrode": 2.0, "crosstalk": 1.0}, seed=7)
    found = diagnosed(recording).diagnosis
    assert found.claims[0].effect.name == "crosstalk"
    assert found.verdict == "partly_explained"
    assert truth.parameters("intermittent_electrode")["electrode"] in found.electrodes
    assert "loose" in (found.reason or "")
