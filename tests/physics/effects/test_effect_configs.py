"""Every effect is a choice of the ``effects`` group, and its file builds it."""

from __future__ import annotations

import pytest
import yaml

from ertskin.configuration import config_dir
from ertskin.physics.effects.registry import build_effects, effect_classes


@pytest.mark.parametrize("name", effect_classes())
def test_each_effect_is_a_choice(name: str) -> None:
    settings = yaml.safe_load((config_dir() / "effects" / f"{name}.yaml").read_text(encoding="utf-8"))
    (effect,) = build_effects(settings)
    assert effect.name == name
    neutral = {key: known.neutral for key, known in effect.parameters().items() if known.defining}
    assert not neutral or any(getattr(effect, key) != value for key, value in neutral.items())
