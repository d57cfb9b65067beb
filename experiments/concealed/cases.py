"""Which skins the suite hides: every class of the study, several strengths, all fixed by one seed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ertskin.hardware.virtual.bench import EFFECTS, Noise

LISTED = tuple(name for name, effect in EFFECTS.items() if effect.listed)
UNLISTED = tuple(name for name, effect in EFFECTS.items() if not effect.listed)
RATIOS = (1.01, 1.1, 1.5, 2.5)
TWINS = (
    ("piezo_creep", "temperature_drift"),
    ("piezo_hysteresis", "viscoelastic_foam"),
    ("indenter_offset", "piezo_inhomogeneity"),
    ("foam_hysteresis", "foam_softening"),
)
BEHIND = (
    ("contact_pressure_dependence", 1.2, "sheet_inhomogeneity", 2.5),
    ("electrode_displacement", 1.2, "sheet_anisotropy", 2.5),
    ("crosstalk", 1.1, "channel_gain", 2.5),
    ("scan_skew", 1.1, "piezo_hysteresis", 2.5),
    ("piezo_creep", 1.1, "temperature_drift", 2.5),
    ("foam_hysteresis", 1.5, "nonlinear_foam", 10.0),
    ("indenter_offset", 1.1, "piezo_inhomogeneity", 2.5),
    ("adc_saturation", 1.1, "sheet_inhomogeneity", 2.5),
)
BEHIND_CALIBRATION = ("contact_pressure_dependence", "electrode_displacement", "sheet_inhomogeneity", "nonlinear_foam")
BLIND = (
    ("no_unloading", "piezo_hysteresis"),
    ("no_unloading", "foam_hysteresis"),
    ("no_unloading", "foam_softening"),
    ("one_speed", "viscoelastic_foam"),
    ("one_speed", "piezo_creep"),
    ("one_speed", "foam_softening"),
)
NULLS = {
    "null": (Noise(), False),
    "null_coloured": (Noise(coloured_share=0.4), False),
    "null_wrong_guesses": (Noise(), True),
}
SMALL_SINGLES = ("piezo_hysteresis", "sheet_anisotropy", "channel_gain", "viscoelastic_foam", "electrode_displacement")


@dataclass(frozen=True)
class Case:
    """One hidden skin: its class, the plan it is recorded with, and each effect's own ratio to the noise."""

    name: str
    kind: str
    seed: int
    plan: str
    ratios: dict[str, float] = field(default_factory=dict)
    noise: Noise = field(default_factory=Noise)
    wrong_guesses: bool = False


def _recipes(small: bool, rng: np.random.Generator) -> list[tuple[str, str | None, dict[str, float], Noise, bool]]:
    """(kind, plan or None for the suite's own, ratios, noise, wrong guesses) of every case, in order of class."""
    default = Noise()
    counts = {"null": 1, "null_coloured": 1, "null_wrong_guesses": 1} if small else {"null": 24, "null_coloured": 20}
    recipes: list[tuple[str, str | None, dict[str, float], Noise, bool]] = []
    for kind, (noise, wrong) in NULLS.items():
        recipes += [(kind, None, {}, noise, wrong)] * counts.get(kind, 20)
    singles = SMALL_SINGLES if small else LISTED
    recipes += [("single", None, {name: r}, default, False) for name in singles for r in ((1.5,) if small else RATIOS)]
    recipes += [("compound", None, _several(rng, 2), default, False) for _ in range(1 if small else 20)]
    recipes += [("compound", None, _several(rng, 3), default, False) for _ in range(0 if small else 6)]
    for name in ("torn_patch", "mains_hum") if small else UNLISTED:
        recipes += [("unlisted", None, {name: r}, default, False) for r in ((1.5,) if small else (1.5, 2.5))]
    if not small:
        recipes += [("concealed", None, {weak: w, strong: s}, default, False) for weak, w, strong, s in BEHIND]
        recipes += [("concealed", None, {name: 1.2}, default, True) for name in BEHIND_CALIBRATION]
        recipes += [("twin", None, {name: 1.5}, default, False) for pair in TWINS for name in pair]
    recipes += [("blind", plan, {name: 1.5}, default, False) for plan, name in (BLIND[:1] if small else BLIND)]
    return recipes


def _several(rng: np.random.Generator, count: int) -> dict[str, float]:
    names = rng.choice(LISTED, count, replace=False)
    return {str(name): float(rng.choice([1.5, 2.0])) for name in names}


def suite(seed: int, small: bool) -> list[Case]:
    """Every case of the suite. Names are shuffled numbers: they tell nothing about the class."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, int(small)]))
    recipes = _recipes(small, rng)
    order = rng.permutation(len(recipes))
    seeds = rng.integers(2**31, size=len(recipes))
    cases = [
        Case(f"c{order[number]:03d}", kind, int(seeds[number]), plan or ("quick" if small else "half"), ratios, *rest)
        for number, (kind, plan, ratios, *rest) in enumerate(recipes)
    ]
    return sorted(cases, key=lambda case: case.name)
