"""Which skins a suite hides, drawn from its secret: nulls, single effects, compounds, families in no list.

Every case has a skin of its own (outline, electrodes, pad, scan, number of presses, noise) and a form of each effect.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from generator.fabric import AdheringFabric, AgeingCreep, DuhemFabric, StretchedCreep
from generator.families import FIRST, SECOND, THIRD
from generator.forms import FORMS
from generator.skins import PADS, SHAPES

SPLIT = Path(__file__).with_name("families_split.json")
BATCHES = {20261122: tuple(FIRST), 20261129: tuple(SECOND), 20261201: tuple(THIRD)}
"""Families by the seed of the draw that halves them."""
SCANS = ("full", "full", "adjacent", "sparse")
PRESSES = (6, 9, 12, 12, 18, 36)
SINGLE_RATIOS = (1.15, 1.5, 2.5)
NULLS = {"null": 24, "null_coloured": 24, "null_wrong_guesses": 24, "null_odd_specimen": 24, "null_noisy": 16}
ODD = {k.form: k for k in (AdheringFabric, DuhemFabric, StretchedCreep, AgeingCreep)}


@dataclass(frozen=True)
class Hidden:
    """One effect to be hidden: name, form (of a family: ``only``), own ratio wanted."""

    name: str
    form: str
    ratio: float


@dataclass(frozen=True)
class Case:
    """One recording to be made. ``specimen``: ``same`` cloth, ``none`` of the skin's memory, or an odd form."""

    name: str
    kind: str
    seed: int
    shape: str
    pad: str
    scan: str
    presses: int
    hidden: tuple[Hidden, ...] = ()
    coloured_share: float = 0.0
    noise_v: float = 2e-3
    wrong_guesses: bool = False
    specimen: str = "same"
    details: dict[str, Any] = field(default_factory=dict)


def draw_split(seed: int) -> dict[str, list[str]]:
    """Half of a batch may be looked at, half is sealed until the last run of a seed: one committed draw a batch."""
    batch = sorted(BATCHES[seed])
    order = [batch[i] for i in np.random.default_rng(seed).permutation(len(batch))]
    half = len(order) // 2
    return {"open": sorted(order[:half]), "sealed": sorted(order[half:])}


def whole_split() -> dict[str, list[str]]:
    """Every batch's draw, one after the other."""
    drawn = [draw_split(seed) for seed in BATCHES]
    return {half: [name for one in drawn for name in one[half]] for half in ("open", "sealed")}


def families(final: bool) -> list[str]:
    """Families a suite may use: open and spent ones, or the sealed ones that no earlier seed has spent."""
    split = json.loads(SPLIT.read_text())
    spent = [name for names in split["spent"].values() for name in names]
    return [n for n in split["sealed"] if n not in spent] if final else split["open"] + spent


def generator_of(secret: bytes, *names: str) -> np.random.Generator:
    """Random numbers that only who knows the secret can draw."""
    digest = hashlib.sha256("/".join(names).encode() + secret).digest()
    return np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))


def suite(secret: bytes, chosen: list[str], small: bool = False) -> list[Case]:
    """Every case, with the ``chosen`` families; names are shuffled numbers and tell nothing of the class."""
    rng = generator_of(secret, "suite")
    recipes = _nulls(small) + _singles(rng, small) + _compounds(rng, small)
    ratios = (1.6,) if small else (1.6, 3.0)
    recipes += [("family", (Hidden(name, "only", ratio),), {}) for name in chosen for ratio in ratios]
    order = rng.permutation(len(recipes))
    return sorted((_case(rng, int(n), *recipe) for n, recipe in zip(order, recipes, strict=True)), key=lambda c: c.name)


Recipe = tuple[str, tuple[Hidden, ...], dict[str, Any]]


def _nulls(small: bool) -> list[Recipe]:
    extra: dict[str, dict[str, Any]] = {
        "null": {}, "null_coloured": {"coloured_share": 0.4}, "null_wrong_guesses": {"wrong_guesses": True},
        "null_odd_specimen": {"specimen": "odd"}, "null_noisy": {"noise_v": 6e-3},
    }  # fmt: skip
    return [(kind, (), extra[kind]) for kind, count in NULLS.items() for _ in range(1 if small else count)]


def _singles(rng: np.random.Generator, small: bool) -> list[Recipe]:
    found: list[Recipe] = []
    for name, forms in FORMS.items():
        for form in forms[:1] if small else forms:
            for ratio in (1.5,) if small else SINGLE_RATIOS:
                extra: dict[str, Any] = {}
                if name in ("piezo_hysteresis", "piezo_creep") and rng.random() < 0.3:
                    extra = {"specimen": str(rng.choice(["none", "odd"]))}
                found.append(("single", (Hidden(name, form.form, ratio),), extra))
    return found


def _compounds(rng: np.random.Generator, small: bool) -> list[Recipe]:
    found: list[Recipe] = []
    for count, times in ((2, 2 if small else 28), (3, 0 if small else 12)):
        for _ in range(times):
            names = [str(n) for n in rng.choice(list(FORMS), count, replace=False)]
            forms = [FORMS[n][int(rng.integers(len(FORMS[n])))].form for n in names]
            hidden = tuple(Hidden(n, f, float(rng.choice([1.5, 2.0, 3.0]))) for n, f in zip(names, forms, strict=True))
            found.append(("compound", hidden, {}))
    return found


def _case(rng: np.random.Generator, number: int, kind: str, hidden: tuple[Hidden, ...], extra: dict[str, Any]) -> Case:
    shape, pad, scan = (str(rng.choice(options)) for options in (SHAPES, PADS, SCANS))
    presses, seed = int(rng.choice(PRESSES)), int(rng.integers(2**31))
    if extra.get("specimen") == "odd":
        extra = {**extra, "specimen": str(rng.choice(sorted(ODD)))}
    if any(one.name in ("foam_softening", "contact_drift", "temperature_drift") for one in hidden):
        presses = max(presses, 12)
    extra = {"noise_v": 6e-3 if rng.random() < 0.15 else 2e-3, **extra}
    return Case(f"c{number:03d}", kind, seed, shape, pad, scan, presses, hidden, **extra)


if __name__ == "__main__":
    spent = json.loads(SPLIT.read_text())["spent"] if SPLIT.exists() else {}
    SPLIT.write_text(json.dumps({**whole_split(), "spent": spent}, indent=1) + "\n")
