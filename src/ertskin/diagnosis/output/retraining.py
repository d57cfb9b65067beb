"""What training with the effects found does to the networks, on test recordings that no fit has seen."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ertskin.errors import UserError
from ertskin.steps import run_step


@dataclass(frozen=True)
class Retraining:
    """Test recordings, at least one, the networks to train with their seeds, and words handed on to every step."""

    one: Path | None
    two: Path | None
    models: tuple[str, ...]
    seeds: tuple[int, ...]
    settings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.one is None and self.two is None:
            raise UserError("retrain=true needs test recordings to compare on: give one=FILE, two=FILE or both")

    def compared(self, recording: Path, effects: str, out: Path) -> dict[str, dict[str, dict[str, float]]]:
        """{"without"|"with": {model: {metric: mean over seeds}}}: trained without and with ``effects``.

        ``effects`` is the choice a diagnosis has written. Below ``out`` lie the trainings and the two reports.
        """
        choices = {"without": "none", "with": effects}
        return {name: self._trained(recording, choice, out / name) for name, choice in choices.items()}

    def _trained(self, recording: Path, effects: str, out: Path) -> dict[str, dict[str, float]]:
        common = [f"recording={recording}", *self.settings]
        sweep = [f"model={','.join(self.models)}", f"seed={','.join(map(str, self.seeds))}"]
        run_step(["train", "-m", *common, f"effects={effects}", *sweep, f"out={out / 'train'}"])
        tests = [f"{role}={path}" for role, path in (("one", self.one), ("two", self.two)) if path is not None]
        folders = [f"trained={out / 'train'}", f"out={out / 'evaluate'}", "yardsticks=[]"]
        run_step(["evaluate", *common, *tests, *folders])
        return scores(json.loads((out / "evaluate" / "evaluation.json").read_text(encoding="utf-8")), self.models)


def scores(evaluation: dict, models: Sequence[str]) -> dict[str, dict[str, float]]:  # type: ignore[type-arg]
    """{model: {metric: mean over its seeds}} of an ``evaluation.json``."""
    found: dict[str, dict[str, float]] = {}
    for method in evaluation["methods"]:
        if method["name"] in models:
            metrics = [seed["metrics"] for seed in method["seeds"]]
            found[method["name"]] = {key: float(np.mean([m[key]["value"] for m in metrics])) for key in metrics[0]}
    return found
