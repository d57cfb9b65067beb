"""What a table of runs calls a training."""

import pytest
from omegaconf import OmegaConf

from ertskin.training import request


@pytest.mark.parametrize(
    ("chosen", "sweep", "name"),
    [
        ({"model": "contacts", "effects": "none", "grid": "recording"}, ["seed"], "contacts seed 1"),
        ({"model": "contacts", "effects": "mine"}, ["seed"], "contacts mine seed 1"),
        ({"model": "reciprocal", "effects": "mine", "grid": "3x3"}, ["effects"], "reciprocal 3x3 mine seed 1"),
        ({"model": "reciprocal", "effects": "none"}, ["effects", "model.width"], "reciprocal none width 4 seed 1"),
    ],
)
def test_a_training_is_named_by_its_effects_and_by_what_is_swept(monkeypatch, chosen, sweep, name):
    monkeypatch.setattr(request, "choices", lambda: chosen)
    monkeypatch.setattr(request, "swept", lambda: sweep)
    config = OmegaConf.create({"model": {"name": "any", "width": 4}, "seed": 1})
    assert request.job_name(config) == name
