"""The report's account of a diagnosis: what was named, what that changed, and what had been hidden."""

from __future__ import annotations

import json
import types
from pathlib import Path

import numpy as np
import pytest
import report_examples as examples
from omegaconf import OmegaConf

from ertskin.errors import UserError
from ertskin.evaluation.evaluate import Story
from ertskin.report.figures.before_and_after import LEAST, before_and_after
from ertskin.report.sections.change import change
from ertskin.report.sections.lacking import _how_sure
from ertskin.report.sections.opened import opened

HIDDEN = {"piezo_hysteresis": {"width": 0.12, "decay_pa": 2.5e3}}


def test_the_seal_opened_says_what_was_right():
    right = opened(HIDDEN, ("piezo_hysteresis",), 64 * "a")
    assert right.words[-1] == "Named and there: piezo hysteresis."
    assert [cell[0] for cell in right.tables[0].rows[0].cells] == ["piezo hysteresis", ""]
    assert "width: 0.12" in right.tables[0].rows[0].cells[1][1]
    wrong = opened(HIDDEN, ("foam_creep",), 64 * "a")
    assert wrong.words[-1] == "Hidden and not named: piezo hysteresis. Named and not there: foam creep."
    assert opened({}, (), 64 * "a").words[-1] == "Nothing was hidden, and nothing was named."
    assert opened({}, None, 64 * "a").words[-1] == "No diagnosis was made."


def test_before_and_after_stand_in_one_table():
    before, after = examples.method("a", "network", 0.6, 2), examples.method("a (with loop)", "network", 0.1, 2)
    section = change([before, after], [("a", "a (with loop)"), ("b", "b (with loop)")])
    assert section is not None
    rows = {row.cells[0][0]: row.cells[1][0] for row in section.tables[0].rows}
    force = [method.values("force_rmse_one_n").mean() for method in (before, after)]
    assert rows["force RMSE, one point / N"] == f"{force[0]:.2f} → {force[1]:.2f}"
    assert change([before, after], []) is None


def test_rounding_does_not_set_the_axis():
    figure = before_and_after(["a"], ["place / mm", "force / N"], np.array([[[1e-14, 0.5], [2.0, 0.1]]]))
    drawn = np.concatenate([line.get_xdata() for line in figure.axes[0].lines])
    assert drawn.min() == LEAST
    assert drawn.max() == 2.0


@pytest.mark.parametrize(("key", "said"), [("diagnosis", "absent: no diagnosis.json"), ("sealed", "no seal to open")])
def test_what_is_not_there_is_refused(key: str, said: str, tmp_path: Path):
    given = {"diagnosis": None, "sealed": None, "recording": str(tmp_path / "a.h5")} | {key: str(tmp_path / "absent")}
    with pytest.raises(UserError, match=said):
        Story.of(OmegaConf.create(given))


def test_a_diagnosis_is_read_from_its_folder(tmp_path: Path):
    (tmp_path / "diagnosis.json").write_text(json.dumps({"effects": []}))
    config = types.SimpleNamespace(diagnosis=str(tmp_path), sealed=None)
    assert Story.of(config) == Story(tmp_path, None)


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        ({"confidence": 0.014, "name_confidence": 0.99}, "0.99, with its map 0.01"),
        ({"confidence": 0.99, "name_confidence": 0.99}, "0.99"),
        (
            {"confidence": 0.95, "name_confidence": 0.99, "confidence_everywhere": 0.02},
            "0.99, with its map 0.95 (0.02 over the whole sheet)",
        ),
        ({"confidence": 0.87}, "0.87"),
    ],
    ids=["map unknown", "map known", "known in part", "as written before"],
)
def test_a_field_is_as_sure_as_its_name_and_as_its_map(effect: dict[str, float], said: str):
    assert _how_sure(effect) == said
