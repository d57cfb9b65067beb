"""The trained networks to be evaluated: found, loaded, grouped by what differs besides the seed."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.models.reconstruction import Reconstruction
from ertskin.report.words import name_in_words
from ertskin.tracking.model import model_file
from ertskin.tracking.run import flattened
from ertskin.tracking.settings import TrackingSettings

Array = NDArray[np.float64]
Group = dict[int, Reconstruction]
EFFECTS = "effects"
# Parts of a training's configuration that don't make it another method.
ASIDE = ("seed", "tracking", "out", "cluster", "recording", "calibration", "experiment")


def given_models(names: Sequence[str], tracking: TrackingSettings) -> list[Reconstruction]:
    """Models named by a file, by the folder of a job, or by the id of an MLflow run."""
    return [Reconstruction.load(model_file(name, tracking)) for name in names]


def finished_models(folder: Path, recording: Path) -> list[Reconstruction]:
    """Models of all jobs below ``folder`` that learned from ``recording``; ``UserError`` where there is none.

    A model that can't be loaded, as one of an earlier version, is said on the error stream and left out.
    """
    models = []
    for done in sorted(folder.glob("*/done.json")):
        try:
            models.append(Reconstruction.load(done.parent / "model.pt"))
        except UserError as error:
            print(f"left out: {error}", file=sys.stderr, flush=True)
    own = [model for model in models if _same(model.about["config"].get("recording"), recording)]
    if not own:
        raise UserError(
            f"no finished training on {recording} below {folder}: run ertskin train recording={recording}, "
            "or name models=[FILE,...]"
        )
    return own


def on_grid(group: Group, taxel_m: Array) -> Group:
    """Those that answer for the taxels ``taxel_m`` (n,2); a network for another grid can't be compared on this one."""
    return {seed: model for seed, model in group.items() if _taxels_equal(model, taxel_m)}


def grouped(models: Sequence[Reconstruction]) -> dict[str, Group]:
    """Name -> seed -> model. Trainings that differ in more than the seed get names that say in what.

    Of effects the name says which were simulated, and of their parameters those that only trainings with the same
    effects differ in.
    """
    configs = [_compared(model) for model in models]
    groups: dict[str, Group] = {}
    for model, config in zip(models, configs, strict=True):
        name = str(config.get("model.name", type(model.network).__name__))
        alike = [other for other in configs if other.get("model.name") == config.get("model.name")]
        same = [other for other in alike if other[EFFECTS] == config[EFFECTS]]
        differing = {
            key
            for key in config
            if any(other.get(key) != config[key] for other in (same if _parameter_of_effect(key) else alike))
        }
        words = [f"{_heading(key)} {config[key]}" for key in sorted(differing) if key != EFFECTS]
        if EFFECTS in differing and config[EFFECTS]:
            words.insert(0, f"with {name_in_words(config[EFFECTS])}")
        seeds = groups.setdefault(f"{name} ({', '.join(words)})" if words else name, {})
        seeds[int(_config(model).get("seed", len(seeds)))] = model
    return groups


def without_and_with(groups: Mapping[str, Group]) -> list[tuple[str, str]]:
    """Pairs of names of ``grouped`` that differ in the effects alone: simulated without any, and with some."""
    without: dict[str, str] = {}
    for name, seeds in groups.items():
        model = next(iter(seeds.values()))
        if not _effects(model):
            without[_kind(model)] = name
    found = []
    for name, seeds in groups.items():
        model = next(iter(seeds.values()))
        if _effects(model) and _kind(model) in without:
            found.append((without[_kind(model)], name))
    return found


def _compared(model: Reconstruction) -> dict[str, Any]:
    """What tells one method from another, flat; ``EFFECTS`` are the names of all effects simulated."""
    flat = {k: v for k, v in flattened(_config(model)).items() if k.split(".")[0] not in ASIDE}
    return flat | {EFFECTS: ", ".join(_effects(model))}


def _parameter_of_effect(key: str) -> bool:
    return key.startswith(f"{EFFECTS}.")


def _heading(key: str) -> str:
    return key.removeprefix("model.").removeprefix(f"{EFFECTS}.")


def _kind(model: Reconstruction) -> str:
    compared = _compared(model).items()
    return repr(sorted((key, str(value)) for key, value in compared if key.split(".")[0] != EFFECTS))


def _effects(model: Reconstruction) -> tuple[str, ...]:
    return tuple(_config(model).get(EFFECTS) or ())


def _config(model: Reconstruction) -> dict[str, Any]:
    return dict(model.about.get("config", {}))


def _same(named: str | None, recording: Path) -> bool:
    return named is not None and Path(named).resolve() == recording.resolve()


def _taxels_equal(model: Reconstruction, taxel_m: Array) -> bool:
    own = model.network.answers_m
    return own.shape == taxel_m.shape and np.allclose(own, taxel_m, atol=1e-6)
