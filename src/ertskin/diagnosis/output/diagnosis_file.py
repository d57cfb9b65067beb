"""A diagnosis on disk: diagnosis.json, and the effects as a choice that synthesize and train take at once."""

from __future__ import annotations

import json
from pathlib import Path

import yaml

from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.files import write_whole
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.registry import effects_config


def write_diagnosis(folder: Path, diagnosis: Diagnosis) -> Path:
    """``folder/diagnosis.json``, written aside and renamed."""
    return write_whole(folder / "diagnosis.json", json.dumps(finite(diagnosis.as_builtins()), indent=1) + "\n")


def write_effects(folder: Path, name: str, effects: tuple[Effect, ...], recording: str) -> Path:
    """``folder/effects/name.yaml``: with ``--config-dir folder``, or below runs/conf, ``effects=name`` chooses it."""
    head = f"# What a diagnosis of {recording} says the simulator leaves out.\n"
    body = yaml.safe_dump(effects_config(effects), sort_keys=False) if effects else "{}\n"
    return write_whole(folder / "effects" / f"{name}.yaml", head + body)


def finite(value: object) -> object:
    """JSON has no NaN and no infinity."""
    if isinstance(value, dict):
        return {key: finite(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value.item() if hasattr(value, "item") else value
