"""The diagnosis's page: names and units in words, commands to copy, and no figure without anything in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, Estimate, HeldOut
from ertskin.diagnosis.judge.axis_tests import AxisTest, axis_tests
from ertskin.diagnosis.judge.quantities import field_map
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.output.figures import figures, write_figures
from ertskin.diagnosis.output.report import _about, write_report
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from ertskin.physics.history import History
from ertskin.report.words import words_of


def findings() -> Findings:
    """What a diagnosis of nine presses on the paper's skin hands to its page, the residuals drawn."""
    random = np.random.default_rng(0)
    sensor = nominal_sensor()
    place = np.repeat(sensor.taxel_m[[0, 5, 7, 10, 14, 21, 25, 30, 35]], 3, axis=0)[:, None]
    phase = np.tile(np.array([1, 2, 3], np.uint8), 9)
    depth = np.tile([1e-3, 2e-3, 1e-3], 9)[:, None]
    history = History(np.arange(27.0), np.repeat(np.arange(9), 3), phase, place, depth, 1e3 * depth)
    stress = np.concatenate([np.linspace(0, 6e4, 20), np.linspace(6e4, 0, 20)])
    fit = SimpleNamespace(residual=random.normal(size=(27, 1)))
    baseline = SimpleNamespace(
        force_linear=fit,
        force_best=fit,
        force_noise=SimpleNamespace(rms_n=0.01),
        specimen=SimpleNamespace(stress_pa=stress, resistance_ohm_sq=18e3 * np.exp(-stress / 4e4)),
    )
    claim = Claim(
        IndenterOffset(dx_m=1e-3, dy_m=-5e-4),
        0.97,
        1.8,
        {"dx_m": Estimate(1e-3, 0.9e-3, 1.1e-3, "m"), "dy_m": Estimate(-5e-4, -6e-4, -4e-4, "m")},
        (("sheet_inhomogeneity", 0.03),),
    )
    sheet = SheetInhomogeneity(gradient_x=0.1)
    field = field_map(sheet, sensor)
    assert field is not None
    known = replace(field, error=np.full(len(field.value), 0.01), determined=field.point_m[:, 1] > 0.06)
    spread = {"log_spread": Estimate(0.03, 0.02, 0.04, "1")}
    mapped = Claim(sheet, 0.99, 8.9, {}, quantities=spread, field_map=known)
    held = HeldOut("9 presses", 2e-3, 2.1, 1.01, 0.0, 0.02, 0.004)
    tests = (AxisTest("electrode", tuple(map(str, range(24))), tuple(1 + random.random(24)), 0.0),)
    return Findings(
        Diagnosis("skin.h5", "explained", held, claims=(claim, mapped)),
        evidence=cast(Any, SimpleNamespace(history=history, sensor=sensor, noise_v=2e-3)),
        baseline=cast(Any, baseline),
        held=np.arange(27),
        residual_before=2 * random.normal(size=(27, 276)),
        residual_after=random.normal(size=(27, 276)),
        tests_before=tests,
        tests_after=tests,
    )


def test_names_and_units_are_words(tmp_path: Path) -> None:
    found = findings()
    drawn = write_figures(tmp_path, found)
    assert all((tmp_path / one.as_builtins()["file"]).is_file() for one in drawn)
    path = write_report(tmp_path, found, drawn, ("ertskin train recording=skin.h5 effects=skin",), ("commit abc",))
    text = path.read_text(encoding="utf-8")
    for words in (
        "Diagnosis of skin.h5: explained",
        "indenter offset",
        "dx 1 mm (0.9 to 1.1)",
        "sheet inhomogeneity (0.03)",
        "log spread 0.03 (0.02 to 0.04)",
        "The unloaded sheet resistance varies over the sheet.",
        "<dt>20 mN</dt><dd>force misfit (rms) before</dd>",
        "<dt>4 mN</dt><dd>force misfit (rms) after</dd>",
        "&lt; 1e-300",
        "<pre>ertskin train recording=skin.h5 effects=skin",
        "commit abc",
    ):
        assert words in text, words
    assert "indenter_offset" not in text
    assert words_of("sensitivity_per_pa") == "sensitivity"


def test_every_figure_drawn_has_something_in_it() -> None:
    for title, _, draw in figures(findings()):
        for axis in draw().axes:
            assert axis.has_data(), title


def test_a_field_found_is_drawn_where_the_recording_tells_it() -> None:
    draw = next(draw for title, _, draw in figures(findings()) if title == "What was found over the sheet")
    axis = draw().axes[0]
    percent = axis.collections[0].get_array()
    shown = np.ma.getmaskarray(percent)
    assert axis.get_title(loc="left") == "sheet inhomogeneity"
    assert shown[:12].all()
    assert not shown[12:].any()
    assert np.ma.max(percent) == pytest.approx(100 * np.expm1(0.05 * 23 / 24))


def test_a_place_is_named_in_millimetres() -> None:
    found = findings()
    assert found.evidence is not None
    assert found.residual_before is not None
    history = found.evidence.history
    tests = axis_tests(found.residual_before, history, nominal_protocol(found.evidence.sensor))
    labels = {test.axis: test.label for test in tests}
    assert "(10, 10) mm" in labels["place"]
    assert all(" to " in label for label in labels["force"])


def test_what_has_no_figures_is_a_page_all_the_same(tmp_path: Path) -> None:
    refused = Diagnosis("a.h5", "cannot_tell", HeldOut("none", None, None, None, None), reason="no protocol")
    text = write_report(tmp_path, Findings(refused), []).read_text(encoding="utf-8")
    assert "cannot tell" in text
    assert "no protocol" in text
    assert "<img" not in text


@pytest.mark.parametrize("kind", effect_classes().values(), ids=lambda kind: kind.name)
def test_what_an_effect_is_is_said_in_whole_sentences(kind: type[Effect]) -> None:
    said = _about(Claim(kind(), 0.9, 2.0, {}))
    form = said.removesuffix(f" ({kind.source}).")
    assert form != said
    whole = " ".join((kind.__doc__ or "").replace("``", "").split())
    assert f"{form.split('. ', 1)[1]}." in whole
    assert not form.endswith((",", " and", " an", ":"))
