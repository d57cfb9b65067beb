"""One hidden skin beside what a diagnosis said of it, and the judgement of every claim."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from comparable import parameters

from ertskin.hardware.virtual.bench import EFFECTS, Truth
from ertskin.hardware.virtual.bench.sealing import unseal

CONFIDENT = 0.9
LIKELY = 0.5
VERDICTS = ("no_mismatch", "explained", "partly_explained", "unexplained", "cannot_tell")


NO_ANSWER = {"format": "ertskin-diagnosis", "format_version": 1, "verdict": "cannot_tell", "effects": []}


class DiagnosisError(ValueError):
    """A diagnosis that breaks the contract: one line naming the file and what is wrong."""


@dataclass(frozen=True)
class Judged:
    """A case opened: the truth, and the diagnosis as its author wrote it."""

    name: str
    truth: Truth
    about: dict[str, Any]
    diagnosis: dict[str, Any]

    @property
    def kind(self) -> str:
        """Class of the case."""
        return str(self.about["kind"])

    @property
    def is_null(self) -> bool:
        """Nothing is left out."""
        return not self.truth.effects

    @property
    def listed(self) -> list[str]:
        """Hidden effects that have a name."""
        return [name for name in self.truth.effects if EFFECTS[name].listed]

    @property
    def verdict(self) -> str:
        """One of ``VERDICTS``."""
        return str(self.diagnosis["verdict"])

    @property
    def claims(self) -> list[dict[str, Any]]:
        """Effects named, the most confident first; of fields by their names' confidence, for maps aren't judged."""
        said = self.diagnosis.get("effects") or []
        named = [{**one, "confidence": one.get("name_confidence", one["confidence"])} for one in said]
        return sorted(named, key=lambda one: -one["confidence"])

    @property
    def column(self) -> str:
        """Where the case falls in the confusion matrix: the first name, or the verdict where there is none."""
        return str(self.claims[0]["name"]) if self.claims else self.verdict

    @property
    def row(self) -> str:
        """Its row in the confusion matrix: the one effect it hides, or its class."""
        return next(iter(self.truth.effects)) if len(self.truth.effects) == 1 else self.kind

    def is_right(self, claim: dict[str, Any]) -> bool:
        """Whether the effect claimed is in the skin, at the electrode or channel where it is said to be."""
        hidden = self.truth.parameters(claim["name"])
        if hidden is None:
            return False
        stated = claim.get("parameters") or {}
        return all(stated[k]["value"] == hidden[k] for k in ("electrode", "channel") if k in stated and k in hidden)

    @property
    def confident_wrong(self) -> list[str]:
        """Names claimed at ``CONFIDENT`` or more that are not in the skin, or not there."""
        return [one["name"] for one in self.claims if one["confidence"] >= CONFIDENT and not self.is_right(one)]

    @property
    def likely(self) -> list[bool]:
        """Of each claim at ``LIKELY`` or more, whether it is right."""
        return [self.is_right(one) for one in self.claims if one["confidence"] >= LIKELY]

    @property
    def top_right(self) -> bool:
        """The most confident name is right."""
        return bool(self.claims) and self.is_right(self.claims[0])

    @property
    def set_right(self) -> bool:
        """Every hidden name is claimed or stands among a claim's alternatives."""
        named = {one["name"] for one in self.claims}
        named |= {other["name"] for one in self.claims for other in one.get("alternatives") or []}
        return bool(self.listed) and set(self.listed) <= named

    @property
    def all_found(self) -> bool:
        """Every hidden name is claimed outright."""
        return bool(self.listed) and set(self.listed) <= {one["name"] for one in self.claims if self.is_right(one)}

    @property
    def all_likely(self) -> bool:
        """Every hidden name is claimed, each at ``LIKELY`` or more."""
        likely = {one["name"] for one in self.claims if self.is_right(one) and one["confidence"] >= LIKELY}
        return bool(self.listed) and set(self.listed) <= likely

    @property
    def own_ratio(self) -> float:
        """The weakest hidden effect's own ratio to the noise; 1 where nothing is hidden."""
        return min((one["own"] for one in self.about["ratios"].values()), default=1.0)

    def held_out(self, key: str) -> float:
        """A ratio of the held-out part, not-a-number where the diagnosis has none."""
        value = (self.diagnosis.get("held_out") or {}).get(key)
        return float("nan") if value is None else float(value)

    @property
    def true_electrode(self) -> int | None:
        """The electrode or channel an effect sits at."""
        for name in self.truth.effects:
            hidden = self.truth.parameters(name) or {}
            for key in ("electrode", "channel"):
                if key in hidden:
                    return int(hidden[key])
        return None

    @property
    def electrodes_said(self) -> list[int]:
        """Electrodes the diagnosis points at."""
        return [int(one) for one in (self.diagnosis.get("where") or {}).get("electrodes") or []]

    @property
    def distance_m(self) -> float | None:
        """From where the diagnosis points to where the effect is; ``None`` unless both are places on the sheet."""
        said = (self.diagnosis.get("where") or {}).get("position_m")
        centers = [self.truth.effects[name]["parameters"].get("center_m") for name in self.truth.effects]
        true = next((center for center in centers if center), None)
        return None if said is None or true is None else float(np.hypot(*(np.array(said) - np.array(true))))

    def parameter_errors(self) -> list[tuple[str, float, bool]]:
        """(effect.parameter, relative error, inside its interval) of every form-free parameter claimed."""
        found = []
        for claim in self.claims:
            stated = claim.get("parameters") or {}
            for parameter, true in parameters(self.truth, claim["name"]).items():
                if parameter in stated:
                    value, low, high = (stated[parameter][key] for key in ("value", "low", "high"))
                    error = (value - true) / max(abs(true), 1e-12)
                    found.append((f"{claim['name']}.{parameter}", float(error), bool(low <= true <= high)))
        return found


def open_case(name: str, out: Path, method: str) -> Judged | None:
    """The case and its diagnosis, ``None`` where the method has not been tried on it.

    A method that was tried and gave none has named nothing.
    Raises ``SealError`` for a truth that was changed, ``DiagnosisError`` for a diagnosis that breaks the contract.
    """
    path = out / "diagnoses" / method / name / "diagnosis.json"
    if not path.parent.exists():
        return None
    try:
        diagnosis = json.loads(path.read_text()) if path.exists() else NO_ANSWER
    except ValueError as error:
        raise DiagnosisError(f"{path}: not JSON ({error})") from error
    for key, expected in (("format", "ertskin-diagnosis"), ("format_version", 1)):
        if diagnosis.get(key) != expected:
            raise DiagnosisError(f"{path}: {key} is {diagnosis.get(key)!r}, expected {expected!r}")
    if diagnosis.get("verdict") not in VERDICTS:
        raise DiagnosisError(f"{path}: verdict is {diagnosis.get('verdict')!r}, expected one of {VERDICTS}")
    truth, about = unseal(out / "recordings" / f"{name}.h5", out / "sealed")
    return Judged(name, truth, about, diagnosis)
