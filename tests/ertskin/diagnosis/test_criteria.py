"""What a diagnosis decides by stands in one place, says what it is, and reaches the decisions."""

from __future__ import annotations

import ast
import re
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from ertskin import diagnosis
from ertskin.configuration import config_dir
from ertskin.diagnosis.contract.claims import confidences, verdict_of
from ertskin.diagnosis.criteria import DEFAULT, Criteria, described
from ertskin.errors import UserError
from ertskin.settings import checked

MOST = 20
FOLDER = Path(diagnosis.__path__[0])
MODULES = {path.relative_to(FOLDER).as_posix(): path for path in FOLDER.rglob("*.py") if path.name != "criteria.py"}
MOVED = {
    "contract/claims.py": {"MATERIAL_RATIO", "TEMPERATURE"},
    "coupon/diagnosis.py": {"WORSE"},
    "fit/full_solution_check.py": {"WORSE"},
    "force/claims.py": {"WORTH"},
    "force/noise.py": {"MATERIAL", "SURELY"},
    "judge/answer.py": {"SATURATED", "WORTH_SAYING", "DOUBT", "FROZEN"},
    "judge/axis_tests.py": {"LEVEL"},
    "judge/confidence.py": {"FORM", "LEAST", "MATERIAL", "LEFT"},
    "judge/contact_drift_claims.py": {"MATERIAL", "SURE"},
    "judge/repeatability.py": {"MATERIAL", "MOSTLY"},
    "recording/repeating_channels.py": {"BY_CHANCE"},
    "rest/baseline.py": {"FORCE_SIGNIFICANT"},
    "rest/displaced_pad.py": {"WORTH"},
    "rest/rest_frames.py": {"RESTLESS", "JITTER", "TWO_SIGMA"},
    "search/gain.py": {"INDISPENSABLE"},
    "search/smooth_fields.py": {"SIGNIFICANT"},
    "search/trials.py": {"SIGNIFICANT", "MATERIAL"},
    "specimen/fit.py": {"SIGNIFICANT", "MATERIAL", "FORM"},
    "specimen/presses.py": {"MOSTLY"},
    "specimen/signal.py": {"OFF", "NOTICED"},
    "tank/diagnosis.py": {"SIGNIFICANT", "WORTH_SAYING"},
    "tank/displaced_electrodes.py": {"SUREST"},
}
"""Names that the criteria had in the modules that decide by them."""
TELLING = {"significant_gain", "material_ratio", "mismatch_ratio", "chance_ratio", "surest_confidence"}
"""Criteria of which the value stands for nothing else in the diagnosis."""


def tree(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", [each.name for each in fields(Criteria)])
def test_every_criterion_says_what_it_is_and_keeps_to_its_limits(name: str) -> None:
    about = described()[name]
    assert about.unit
    assert about.meaning
    assert about.source
    with pytest.raises(UserError, match=rf"^criteria\.{name} must be (above|at least) ") as refused:
        Criteria(**{name: -1.0})
    assert "\n" not in str(refused.value)


def test_there_are_few() -> None:
    assert len(fields(Criteria)) <= MOST


def test_the_command_s_defaults_are_the_library_s() -> None:
    written = OmegaConf.load(config_dir() / "criteria" / "default.yaml")
    assert list(written.items()) == list(asdict(DEFAULT).items())
    assert checked(Criteria, written, "criteria") == DEFAULT


def test_a_file_of_some_leaves_the_others() -> None:
    assert checked(Criteria, {"chance": 0.01}, "criteria") == replace(DEFAULT, chance=0.01)


def test_every_criterion_decides_something() -> None:
    asked = {node.attr for module in MODULES for node in ast.walk(tree(module)) if isinstance(node, ast.Attribute)}
    assert [each.name for each in fields(Criteria) if each.name not in asked] == []


@pytest.mark.parametrize("module", MODULES)
def test_no_module_keeps_one_of_its_own(module: str) -> None:
    nodes = list(ast.walk(tree(module)))
    stored = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    assert stored & MOVED.get(module, set()) == set()
    numbers = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, float)}
    assert numbers & {getattr(DEFAULT, name) for name in TELLING} == set()


def test_the_page_names_only_numbers_that_stand_in_the_modules() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "criteria.md"
    named = set(re.findall(r"`([A-Z_]{3,})`", page.read_text(encoding="utf-8")))
    nodes = [node for module in MODULES for node in ast.walk(tree(module)) if isinstance(node, ast.Name)]
    assert named
    assert named - {node.id for node in nodes if isinstance(node.ctx, ast.Store)} == set()


def test_a_verdict_is_made_by_them() -> None:
    assert verdict_of(1.2, 1.2, False, DEFAULT) == "unexplained"
    assert verdict_of(1.2, 1.2, False, Criteria(mismatch_ratio=1.3)) == "no_mismatch"
    assert verdict_of(3.0, 1.2, True, DEFAULT) == "partly_explained"
    assert verdict_of(3.0, 1.2, True, Criteria(mismatch_ratio=1.3)) == "explained"


def test_a_name_is_as_sure_as_they_allow() -> None:
    short = (("piezo_creep", 10.0),)
    assert confidences(short, DEFAULT)[0] == pytest.approx(1 / (1 + np.exp(-10.0 / DEFAULT.evidence_discount)))
    assert confidences(short, Criteria(evidence_discount=1.0))[0] == DEFAULT.surest_confidence
    assert confidences(short, Criteria(evidence_discount=1.0, surest_confidence=0.8))[0] == 0.8
