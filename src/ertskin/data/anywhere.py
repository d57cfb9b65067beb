"""Material for networks that are touched anywhere: contacts at random places, from the tabulated response."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import hydra
import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from ertskin.calibration.ready import ready_calibration
from ertskin.calibration.rest_slopes import rest_slopes_v
from ertskin.data.anywhere_plan import AnywherePlan, Stated
from ertskin.data.forward import PressForward
from ertskin.data.grid import grid_m
from ertskin.data.local_discrepancy import LocalDiscrepancy, modes, unknown_error
from ertskin.data.material import Material
from ertskin.data.noise import Evidence
from ertskin.data.simulated import as_builtins, correcting
from ertskin.data.skin_forward import SkinForward, skin_of
from ertskin.data.touch_model import TouchModel
from ertskin.data.touch_table import TablePlan, touch_table
from ertskin.data.touches import Touches, touches_of
from ertskin.data.trials import TrialSet
from ertskin.errors import UserError
from ertskin.hardware.recording import Recording, read_recording
from ertskin.physics.conduction.sheet import Solution
from ertskin.physics.noise.directions import noise_directions
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol
from ertskin.physics.touch.table import ResponseTable
from ertskin.progress import counting
from ertskin.settings import checked

Array = NDArray[np.float64]

ABOVE = 1.15
"""Forces are learned up to this many times the largest of the recording."""
FELT_N = 0.1
"""Frames with less force tell nothing of the response: the indenter has hardly arrived."""
APART_M = 0.012
"""Contacts are drawn at least this far from one another: two indenters of 10 mm don't overlap."""


@dataclass(frozen=True, eq=False)
class AnywhereSkin:
    """A skin touched anywhere, and N trials on it of which each is simulated when it is wanted.

    ``whole``: its response in all coordinates; ``model``: in those that are read. ``contact_m`` (N,C,2), ``force_n``
    (N,C): the trials' contacts, NaN for none. ``taxel_m`` (n,2).
    """

    protocol: Protocol
    noise: Noise
    whole: TouchModel
    model: TouchModel
    taxel_m: Array
    contact_m: Array
    force_n: Array
    seed: int
    checksum: str

    def trials(self, wanted: NDArray[np.intp]) -> TrialSet:
        """The trials numbered ``wanted`` (M,), the same whichever others are."""
        change_ohm = simulated_ohm(self.whole, self.protocol, self.contact_m, self.force_n, self.seed, wanted)
        contact_m, force_n = self.contact_m[wanted], self.force_n[wanted]
        maps_n = force_map_n(contact_m, force_n, self.taxel_m)
        return TrialSet(change_ohm, maps_n, contact_m, force_n, touch=self.model)


def anywhere(config: DictConfig) -> Material:
    """Calibrate, tabulate the response unless that is done, correct it by the recording's presses, and draw trials."""
    skin = anywhere_skin(config, read_recording(config.recording))
    trials = skin.trials(np.arange(len(skin.force_n)))
    return Material(skin.protocol, skin.taxel_m, trials, skin.noise, skin.checksum)


def anywhere_skin(config: DictConfig, recording: Recording) -> AnywhereSkin:
    """``anywhere`` from a recording already read, without simulating any trial yet."""
    plan = checked(AnywherePlan, config.data.plan, "data.plan")
    touches = None if recording.frames is None else touches_of(recording)
    forward, table, checksum = _tabulated(config, recording, plan, touches)
    slope_v = rest_slopes_v(forward.protocol, forward.calibration, forward.resolution)
    evidence = Evidence(forward.protocol, slope_v=slope_v)
    if touches is not None:
        evidence = replace(evidence, rest_v=touches.rest_v, rest_zero=touches.rest_zero)
    noise = hydra.utils.instantiate(config.noise)(evidence)
    whole = touch_model(forward.protocol, table, noise, touches, config.data.discrepancy)
    taxel_m = grid_m(config.grid, forward.calibration.known_sensor)
    model = whole.strongest(int(config.data.components))
    if touches is not None and len(whole.unseen_v):
        known = pressed(touches).history
        model = model.widened(known.contact_m[:, 0], known.force_n[:, 0], FELT_N)
    model = model.with_force_error(checked(Stated, config.data.stated, "data.stated").load_cell_error)
    words = repr((checksum, asdict(plan), config.data.components)).encode() + whole.table.response.tobytes()
    key = hashlib.sha256(words).hexdigest()
    return AnywhereSkin(forward.protocol, noise, whole, model, taxel_m, *drawn(table, plan), plan.seed, key)


def _tabulated(
    config: DictConfig, recording: Recording, plan: AnywherePlan, touches: Touches | None
) -> tuple[SkinForward, ResponseTable, str]:
    if recording.protocol is None:
        raise UserError(f"{config.recording}: has no /protocol, so its readings can't be simulated")
    calibration, checksum = ready_calibration(config, recording)
    largest_n = plan.max_force_n or largest_force_n(touches)
    forward = SkinForward(calibration, recording.protocol, as_builtins(config.effects), config.physics.resolution)
    request = {"calibration": checksum, "effects": forward.effects, "resolution": forward.resolution}
    tabled = checked(TablePlan, config.data.table, "data.table")
    with counting("tabulating the response") as progress:
        cluster = hydra.utils.instantiate(config.cluster)
        table, made = touch_table(Path(config.data.folder), request, tabled, forward, largest_n, cluster, progress)
    return forward, table, made


def largest_force_n(touches: Touches | None) -> float:
    """A little above the largest force of one contact in the recording; the paper's 10 N where it has none."""
    if touches is None or not len(touches):
        return 10.0
    return ABOVE * float(np.nanmax(touches.history.force_n))


def touch_model(
    protocol: Protocol, table: ResponseTable, noise: Noise, touches: Touches | None, correct: bool
) -> TouchModel:
    """The table in units of the noise, corrected by the presses of one contact, and what it may still err by."""
    sample_v = protocol.whitened(_sampled(table))
    matrix, _ = noise_directions(sample_v, noise.covariance_v2)
    seen = table.seen(protocol.whitened(np.eye(table.read.shape[0])) @ matrix)
    error = unknown_error()
    unseen_v: Array = np.zeros((0, len(matrix)))
    real = None if touches is None else pressed(touches)
    if real is not None and len(real) and correct:
        place_m, force_n = real.history.contact_m[:, 0], real.history.force_n[:, 0]
        found, error = LocalDiscrepancy.fit(seen, place_m, force_n, real.history.press, real.change_v @ matrix)
        unseen_v = np.asarray(np.linalg.solve(matrix.T, found.unseen(seen, real.change_v @ matrix).T).T)
        seen = found.correct(seen)
    return TouchModel(seen, matrix, error, unseen_v)


def pressed(touches: Touches) -> Touches:
    """The frames of one contact that correct the simulator, in which the load cell feels it."""
    real = correcting(touches)
    return real[np.flatnonzero(real.history.force_n[:, 0] >= FELT_N)]


def _sampled(table: ResponseTable) -> Array:
    """(n,P) some of the responses: every seventh, or fifth where sevenths would all be of one force."""
    forces, coordinates = table.response.shape[2:]
    return table.response.reshape(-1, coordinates)[:: 7 if forces % 7 else 5].astype(float)


def simulated_ohm(
    model: TouchModel, protocol: Protocol, contact_m: Array, force_n: Array, seed: int, wanted: NDArray[np.intp]
) -> Array:
    """(M,P) changes of the pair resistances in the trials ``wanted`` (M,), each contact's response as wrong as it may
    be: drawn for all trials, so that one is the same whichever others are wanted."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 6]))
    present = np.isfinite(force_n)
    draw = np.zeros((*force_n.shape, 3))
    draw[present] = rng.standard_normal((int(present.sum()), 3)) * model.error.shape_spread
    contact_m, force_n, draw = contact_m[wanted], force_n[wanted], draw[wanted]
    change = model.table.change(contact_m, force_n)
    rows, slots = np.nonzero(present[wanted])
    for some in np.array_split(np.arange(len(rows)), max(1, len(rows) // 2000)):
        row, slot = rows[some], slots[some]
        wrong = modes(model.table, contact_m[row, slot], force_n[row, slot])[:, 3:]
        np.add.at(change, row, np.einsum("nm,nmd->nd", draw[row, slot], wrong))
    return protocol.unwhitened(np.asarray(np.linalg.solve(model.matrix.T, change.T).T))


def skin_at_rest(config: DictConfig, recording: Recording) -> Solution:
    """The calibrated sheet, untouched, as ``config`` has it."""
    calibration, _ = ready_calibration(config, recording)
    if recording.protocol is None:
        raise UserError(f"{config.recording}: has no /protocol, so its readings can't be simulated")
    return PressForward(skin_of(calibration, recording.protocol, {}, config.physics.resolution)).rest


def drawn(table: ResponseTable, plan: AnywherePlan) -> tuple[Array, Array]:
    """(N,C,2) places and (N,C) forces of the plan's trials, NaN for an absent contact."""
    rng = np.random.default_rng(np.random.SeedSequence([plan.seed, 5]))
    grid = table.grid
    low, high = np.array([grid.x_m[0], grid.y_m[0]]), np.array([grid.x_m[-1], grid.y_m[-1]])
    count = 1 + np.arange(plan.trials) % plan.contacts
    contact_m = np.full((plan.trials, plan.contacts, 2), np.nan)
    for slot in range(plan.contacts):
        wanted = np.flatnonzero(count > slot)
        while len(wanted):
            place = rng.uniform(low, high, (len(wanted), 2))
            away = np.linalg.norm(contact_m[wanted, :slot] - place[:, None], axis=2)
            free = (away >= APART_M).all(axis=1)
            contact_m[wanted[free], slot] = place[free]
            wanted = wanted[~free]
    force_n = rng.uniform(plan.min_force_n, grid.force_n[-1], contact_m.shape[:2])
    return contact_m, np.where(np.isfinite(contact_m[..., 0]), force_n, np.nan)


def force_map_n(contact_m: Array, force_n: Array, taxel_m: Array) -> Array:
    """(N,n) newton on the taxel nearest to each contact."""
    maps = np.zeros((len(force_n), len(taxel_m)))
    rows, slots = np.nonzero(np.isfinite(force_n))
    away = np.linalg.norm(contact_m[rows, slots, None] - taxel_m, axis=2)
    np.add.at(maps, (rows, away.argmin(axis=1)), force_n[rows, slots])
    return maps
