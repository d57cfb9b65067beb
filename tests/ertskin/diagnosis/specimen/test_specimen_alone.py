"""A specimen without a skin: memory is named by presses held out, and what the data don't hold is said."""

from dataclasses import replace

import numpy as np

from ertskin.diagnosis.any_recording import diagnose_any
from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.hardware.recording import Recording, Specimen
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

PRESSES, READINGS = 8, 60


def specimen(width: float, seed: int = 0) -> Specimen:
    """Presses of different strength on a film whose logarithm falls with pressure, read with 0.5 % of noise."""
    rng = np.random.default_rng(seed)
    up = np.concatenate([np.linspace(0, 1, READINGS // 2), np.linspace(1, 0, READINGS // 2)])
    stress = np.concatenate([5e4 * share * up for share in rng.uniform(0.6, 1.0, PRESSES)])
    time_s = 0.1 * np.arange(len(stress))
    felt = PiezoHysteresis(width).effective_pressure_pa(stress[:, None], np.zeros((1, 2)), time_s, np.zeros((2, 2)))
    resistance = 2e4 / (1 + felt[:, 0] / 4e3) * (1 + 0.005 * rng.standard_normal(len(stress)))
    return Specimen(stress, resistance, time_s, np.repeat(np.arange(PRESSES), READINGS))


def diagnosed(made: Specimen) -> Diagnosis:
    recording = Recording("press", "", "", specimen=made)
    return diagnose_any(recording, "film.h5", lambda share, text: None).diagnosis


def test_a_loop_is_named_and_predicts_the_presses_held_out():
    found = diagnosed(specimen(0.12))
    assert [claim.effect.name for claim in found.claims] == ["piezo_hysteresis"]
    assert found.held_out.ratio_before > 3 * found.held_out.ratio_after
    assert abs(found.claims[0].effect.width - 0.12) < 0.02


def test_a_film_without_memory_has_none():
    found = diagnosed(specimen(0.0))
    assert found.claims == ()
    assert found.verdict == "no_mismatch"


def test_too_little_says_what_is_missing():
    made = specimen(0.1)
    few = made.cycle < 2
    short = Specimen(made.stress_pa[few], made.sheet_resistance_ohm_sq[few], made.time_s[few], made.cycle[few])
    flat = replace(made, sheet_resistance_ohm_sq=np.full_like(made.time_s, 5.0))
    for one, word in ((short, "press"), (flat, "resistance")):
        found = diagnosed(one)
        assert found.verdict == "cannot_tell"
        assert word in found.reason
