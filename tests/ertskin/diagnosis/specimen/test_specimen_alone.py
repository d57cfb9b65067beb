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


def uneven(width: float) -> tuple[Specimen, np.ndarray]:
    """The same film, every press felt by a factor of its own."""
    made = specimen(0.0)
    factor = np.exp(0.5 * np.random.default_rng(5).standard_normal(PRESSES))
    stress = made.stress_pa * factor[made.cycle]
    felt = PiezoHysteresis(width).effective_pressure_pa(
        stress[:, None], np.zeros((1, 2)), made.time_s, np.zeros((2, 2))
    )
    noise = 1 + 0.005 * np.random.default_rng(1).standard_normal(len(stress))
    return replace(made, sheet_resistance_ohm_sq=2e4 / (1 + felt[:, 0] / 4e3) * noise), factor


def test_presses_that_differ_are_said_to_and_no_memory_is_named_for_it():
    made, factor = uneven(0.0)
    found = diagnosed(made).as_builtins()
    assert (found["verdict"], found["where"]["depends_on"], found["effects"]) == ("unexplained", ["press"], [])
    assert "presses differ" in found["reason"]
    felt = np.array(list(found["presses"]["felt"].values()))
    assert np.std(np.log(felt / factor)) < 0.05


def test_memory_is_named_among_presses_that_differ():
    found = diagnosed(uneven(0.15)[0])
    assert [claim.effect.name for claim in found.claims] == ["piezo_hysteresis"]
    assert found.depends_on == ("press", "history")


def test_presses_that_are_alike_are_not_said_to_differ():
    for width in (0.0, 0.12):
        assert diagnosed(specimen(width)).extra["presses"]["differ"] is False
