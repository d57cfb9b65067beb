"""The skin linearised about its states: the same where it was made, with true derivatives wherever a fit takes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_skin import SMALL, small_law, small_sensor, two_presses

from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.linear.linear_skin import LinearSkin
from ertskin.diagnosis.linear.patches import Patch
from ertskin.diagnosis.linear.pressed_frames import MOTIONS
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.effect import Effect, PiezoEffect
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.nonlinear_foam import NonlinearFoam
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.temperature_drift import TemperatureDrift
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.skin import Skin

NOISE_V = 2e-3


@pytest.fixture(scope="module")
def skin() -> Skin:
    """Six electrodes, a creeping fabric, contacts that follow the pressure and a drifting sheet."""
    effects = (
        PiezoCreep(fraction=0.1, time_s=1.0, decades=2.0, multiplies=True, remembers_air=True),
        ContactPressureDependence(sensitivity_per_pa=1e-4),
        ContactDrift(2, (0.0, 40.0), (0.0, 60.0)),
        TemperatureDrift(rate_per_h=0.2),
    )
    scan = Protocol.against_sink(electrode_pairs(6), 6, 1e-4)
    return Skin.build(small_sensor(), scan, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, effects, SMALL)


@pytest.fixture(scope="module")
def history() -> History:
    return two_presses()


@pytest.fixture(scope="module")
def linear(skin: Skin, history: History) -> LinearSkin:
    force_n = np.nan_to_num(skin.force_n(history))
    return LinearSkin(skin, history, force_n, np.arange(len(history)), None)


def whole(skin: Skin, linear: LinearSkin) -> np.ndarray:
    """(T,P) scans of the skin solved in full."""
    readings = skin.readings_v(linear.history, linear.force_n)
    return readings.reshape(len(readings), -1) @ skin.protocol.orthonormal


def test_it_is_the_skin_where_it_was_made(skin: Skin, linear: LinearSkin) -> None:
    signal = np.ptp(whole(skin, linear), axis=0).max()
    # Whatever moves less than that part shares a solution with its like.
    np.testing.assert_allclose(linear.scans(skin), whole(skin, linear), atol=5e-3 * signal)


def moving_skin(*effects: Effect) -> Skin:
    """Six electrodes, scanned in 0.4 s."""
    pairs = electrode_pairs(6)
    scan = Protocol.against_sink(pairs, 6, 1e-4, injection_offset_s=np.linspace(0.0, 0.4, len(pairs)))
    return Skin.build(small_sensor(), scan, small_law(), np.linspace(200.0, 900.0, 6), 9000.0, effects, SMALL)


def test_presses_may_move_during_the_scan_on_a_skin_with_a_pad_out_of_place(history: History) -> None:
    moving = moving_skin(ElectrodeDisplacement(electrode=1, dx_m=-1e-3, dy_m=1e-3), ScanSkew(speed_m_per_s=1e-3))
    linear = LinearSkin(moving, history, np.nan_to_num(moving.force_n(history)), np.arange(len(history)), None)
    signal = np.ptp(whole(moving, linear), axis=0).max()
    np.testing.assert_allclose(linear.scans(moving), whole(moving, linear), atol=5e-3 * signal)


OWN_COURSE, LIFTING_OFF = ScanSkew(speed_m_per_s=1e-3), ScanSkew(speed_m_per_s=5e-3, at_s=0.2)
STRAIGHT = replace(OWN_COURSE, straight=True)


@pytest.mark.parametrize(
    ("about", "form"),
    [(OWN_COURSE, OWN_COURSE), (OWN_COURSE, STRAIGHT), (STRAIGHT, OWN_COURSE), (LIFTING_OFF, LIFTING_OFF)],
    ids=["own course", "straight, about its own course", "own course, about straight", "lifting off"],
)
def test_moments_of_a_motion_share_the_states_solved_whatever_its_form(
    history: History, about: ScanSkew, form: ScanSkew
) -> None:
    still = moving_skin()
    force_n, frames = np.nan_to_num(still.force_n(history)), np.arange(len(history))
    linear = LinearSkin(still.with_effects([about]), history, force_n, frames, None)
    assert len(linear._patches_at) == len(linear.mixing(about))
    for patches in linear._patches_at.values():
        assert all(mine.solutions is first.solutions for mine, first in zip(patches, linear.patches, strict=True))
    moving = still.with_effects([form])
    signal = np.ptp(whole(moving, linear), axis=0).max()
    np.testing.assert_allclose(linear.scans(moving), whole(moving, linear), atol=5e-3 * signal)


def test_derivatives_are_counted_by_state_and_a_motion_by_its_moments(history: History) -> None:
    still, moving = moving_skin(), moving_skin(OWN_COURSE)
    force_n, frames = np.nan_to_num(still.force_n(history)), np.arange(len(history))
    linear, moves = (LinearSkin(each, history, force_n, frames, None) for each in (still, moving))
    assert (linear.instants(still), linear.instants(moving)) == (1, len(linear.mixing(OWN_COURSE)))
    numbers, electrodes = still.protocol.orthonormal.shape[1], 6
    for counted in (linear, moves):
        states = [(patch, state) for patch in counted.patches for state in patch.states]
        # By each node near a press, each contact and each pad's two shifts.
        unknown = [len(patch.grid_m) + state.contact.shape[1] + 2 * electrodes for patch, state in states]
        assert counted.derivatives == numbers * sum(unknown)
    assert moves.derivatives > linear.derivatives


def test_an_untimed_scan_is_read_at_once(history: History) -> None:
    pairs = electrode_pairs(6)
    scan = Protocol.against_sink(pairs, 6, 1e-4, injection_offset_s=np.full(len(pairs), 0.1))
    moving = Skin.build(
        small_sensor(), scan, small_law(), np.full(6, 500.0), 9000.0, [ScanSkew(speed_m_per_s=1e-3)], SMALL
    )
    linear = LinearSkin(moving, history, np.nan_to_num(moving.force_n(history)), np.arange(len(history)), None)
    signal = np.ptp(whole(moving, linear), axis=0).max()
    np.testing.assert_allclose(linear.scans(moving), whole(moving, linear), atol=5e-3 * signal)


@pytest.mark.parametrize("begun", [(), (ScanSkew(speed_m_per_s=1e-3),)], ids=["still", "moving"])
def test_what_is_remembered_is_never_that_of_another_skin(history: History, begun: tuple[ScanSkew, ...]) -> None:
    """Motions, fabrics and sheets by turns, as a fit steps through them, against a linearised skin that is new."""
    still = moving_skin(*begun)
    force_n = np.nan_to_num(still.force_n(history))
    frames = np.arange(len(history))
    linear, bare = (LinearSkin(still, history, force_n, frames, None) for _ in range(2))
    slow, fast = (ScanSkew(speed_m_per_s=speed) for speed in (8e-4, 1.5e-3))
    loop, wide = (PiezoHysteresis(width=width) for width in (0.1, 0.3))
    even, uneven = (TemperatureDrift(rate_per_h=0.2, gradient_x=gradient) for gradient in (0.0, 0.3))
    aside, foam = IndenterOffset(dx_m=1e-3), NonlinearFoam(stiffening=1.0, carried=0.2)
    family: list[tuple[Effect, ...]] = [
        (),
        (slow,),
        (slow, loop),
        (fast, loop),
        (slow, aside, loop),
        (slow, foam, loop),
    ]
    family += [(slow, wide, even), (slow, wide, uneven), (slow, loop, even), (foam, loop), (), (fast,), (aside,)]
    for effects in family:
        other, moves = still.with_effects(effects), any(isinstance(one, ScanSkew) for one in effects)
        found = linear.skewed(other, force_n) if moves else [linear.still_scans(other, force_n)]
        bare.frames._moved = []
        moments = bare._moments(other, force_n) if moves else [(force_n, bare.patches)]
        for scans, moment in zip(found, moments, strict=True):
            np.testing.assert_array_equal(scans, without_memory(bare, other, *moment))
    assert len(linear.frames.memories) <= MOTIONS * len(linear.mixing(slow))


def without_memory(linear: LinearSkin, skin: Skin, force_n: np.ndarray, patches: list[Patch]) -> np.ndarray:
    """Scans (T,P) of a linearised skin that forgets all it had computed before."""
    linear.frames.memories, linear._latest_field = [], {}
    linear.sheet._latest, linear._elsewhere._latest = (None, None), (None, None)
    return linear.still_scans(skin, force_n, patches)


def test_places_that_creep_show_until_they_have_recovered(skin: Skin, history: History, linear: LinearSkin) -> None:
    """The last frame, in air, sees two places that were pressed; without creep it is the first one but for drifts."""
    creep = skin.effects[0]
    assert isinstance(creep, PiezoCreep)
    strong = skin.with_effects([replace(creep, fraction=0.6), *skin.effects[1:]])
    forgetful = skin.with_effects([replace(creep, fraction=0.6, remembers_air=False), *skin.effects[1:]])
    left = whole(strong, linear)[-1] - whole(forgetful, linear)[-1]
    signal = np.abs(whole(strong, linear)[2] - whole(strong, linear)[0]).max()
    assert np.abs(left).max() > 0.02 * signal
    seen = linear.scans(strong)[-1] - linear.scans(forgetful)[-1]
    # Six times the creep it was linearised about, and to first order about rest.
    np.testing.assert_allclose(seen, left, atol=0.05 * np.abs(left).max())


@pytest.mark.parametrize(
    "effect",
    [PiezoHysteresis(width=0.1, spread=0.5), PiezoCreep(fraction=0.2), PiezoCreep(fraction=0.2, remembers_air=True)],
)
def test_frames_that_are_left_out_of_the_past_would_change_nothing(
    skin: Skin, history: History, linear: LinearSkin, effect: PiezoEffect
) -> None:
    remembering = skin.with_effects([effect])
    contact, rows = remembering.contact_m(history.contact_m), np.array([5, 6, 7])
    points, found = remembering.pressed_conductance_s(history.time_s, contact, linear.force_n, rows)
    position = skin.sheet.quadrature_m.reshape(-1, 2)[points]
    pressure = remembering.pressure_pa(position, contact, linear.force_n)
    fabric = remembering.fabric_ohm_sq(pressure, position, history.time_s, rows)
    np.testing.assert_allclose(found, remembering.sheet_conductance_s(fabric, position), rtol=1e-9)


def test_contact_derivatives_are_those_of_where_the_fit_is(skin: Skin, linear: LinearSkin) -> None:
    frames, pairs = len(linear.history), skin.protocol.orthonormal.shape[1]
    evidence = Evidence(
        sensor=skin.sensor,
        protocol=skin.protocol,
        history=linear.history,
        scan_v=np.zeros((frames, pairs)),
        leftover_v=np.zeros((frames, *skin.protocol.shape), dtype=np.float32),
        noise_v=NOISE_V,
        leftover_noise_v=NOISE_V,
        air_n=0.01,
        saturated_v=None,
        excess_noise=np.zeros((pairs, 0)),
        traces=np.zeros((frames, pairs, 0)),
        leftover_share=1.0,
        repeats=np.zeros(skin.protocol.shape[1], dtype=np.intp),
    )
    cells = np.zeros(frames, dtype=np.intp)
    problem = VoltageProblem(evidence, None, linear, None, cells, np.ones(frames))  # type: ignore[arg-type]
    # As far from where the skin was linearised as a fit may go.
    distant = replace(
        skin, contact_resistance_ohm=skin.contact_resistance_ohm * np.array([0.3, 3.0, 1.0, 0.5, 2.0, 1.0])
    )
    columns = problem.contact_columns(distant)
    for electrode in range(6):
        step = 1e-4 * (np.arange(6) == electrode)
        moved = replace(distant, contact_resistance_ohm=distant.contact_resistance_ohm * np.exp(step))
        change = -(problem.scan_residual(moved) - problem.scan_residual(distant)) / 1e-4
        np.testing.assert_allclose(columns[..., electrode], change, rtol=1e-3, atol=1e-3 * np.abs(change).max())
