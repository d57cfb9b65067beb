"""The paper's 36,000 trials: 36 places x 100 forces of one contact, 32,400 random pairs."""

from __future__ import annotations

import os
import resource
from dataclasses import dataclass
from functools import cache

import numpy as np
from contestants import FactorOnce
from sheets import IndenterPressure, SaturatingLaw, padded_sheet
from single_frame import agree
from stopwatch import Stopwatch

from ertskin.physics.conduction.pressed_sheet import PressedSheet
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.conduction.trials import TrialSolver
from ertskin.physics.protocol import Protocol, electrode_pairs

NOISE_V = 2e-3
PRESSURE, LAW = IndenterPressure(), SaturatingLaw()
PROTOCOL = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
CONTACT_OHM = np.geomspace(100.0, 1000.0, 24)
CHECKED = 24


def presses(pairs: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Contacts (N,2,2) and forces (N,2); NaN for an absent contact. All single presses, then random pairs."""
    taxel = padded_sheet().taxel_m
    rng = np.random.default_rng(seed)
    single = np.repeat(np.arange(36), 100)
    chosen = np.argsort(rng.random((pairs, 36)), axis=1)[:, :2]
    contact = np.full((3600 + pairs, 2, 2), np.nan)
    force = np.full((3600 + pairs, 2), np.nan)
    contact[:3600, 0], force[:3600, 0] = taxel[single], np.tile(np.arange(1, 101) / 10, 36)
    contact[3600:], force[3600:] = taxel[chosen], rng.uniform(0.1, 10.0, (pairs, 2))
    return contact, force


@dataclass(frozen=True, eq=False)
class Solved:
    """The trials put together on one mesh: contacts (N,2,2), forces (N,2), pair resistances (N,276) and at rest."""

    contact_m: np.ndarray
    force_n: np.ndarray
    pair_ohm: np.ndarray
    rest_ohm: np.ndarray
    preparing: Stopwatch
    solving: Stopwatch
    one_thread_cpu_ms_per_trial: float


@cache
def solver(resolution: str, workers: int) -> TrialSolver:
    """Prepared for the 36 taxels and 10 N."""
    taxel_m = padded_sheet().taxel_m
    return TrialSolver.of(padded_sheet(), PRESSURE, LAW, CONTACT_OHM, taxel_m, 10.0, workers, resolution)


@cache
def solved(pairs: int, workers: int, resolution: str = "fine") -> Solved:
    """Prepare, then solve all trials on a number of threads; every ninth once more on one."""
    contact, force = presses(pairs)
    with Stopwatch() as preparing:
        prepared = solver(resolution, workers)
    prepared.pair_resistances(contact[3600:3700], force[3600:3700], workers)
    every = slice(None, None, 9)
    with Stopwatch() as alone:
        prepared.pair_resistances(contact[every], force[every])
    with Stopwatch() as solving:
        pair_ohm = prepared.pair_resistances(contact, force, workers)
    rest_ohm = prepared.pair_resistances(contact[:1], np.zeros((1, 2)))[0]
    return Solved(contact, force, pair_ohm, rest_ohm, preparing, solving, 1e3 * alone.cpu_s / len(contact[every]))


def run(pairs: int, workers: int, resolution: str) -> dict:
    """Times, memory, errors against the same and the reference mesh, and the plain solver's time on the same mesh."""
    made = solved(pairs, workers, resolution)
    contact, force = made.contact_m, made.force_n
    checked = np.random.default_rng(1).choice(len(contact), CHECKED, replace=False)
    checked[:4] = 3600 + np.flatnonzero(_gap(contact[3600:]) < 0.021)[:4]
    same = _direct(resolution)
    error = {
        name: made.pair_ohm[checked] - sheet.pair_resistances(contact[checked], force[checked])
        for name, sheet in (("same_mesh", same), ("reference", _direct("reference")))
    }
    one = same.solve(contact[checked[0]], force[checked[0]])
    factor_once = FactorOnce(same.sheet.mesh, same.sheet.space.degree, CONTACT_OHM, PROTOCOL)
    with Stopwatch() as factoring:
        theirs = factor_once.pair_resistances(one.conductivity_s)
    agree(one.pair_resistance_ohm, theirs)
    return {
        "resolution": resolution,
        "nodes": same.sheet.space.nodes,
        "trials": len(contact),
        "workers": workers,
        "preparation_s": made.preparing.wall_s,
        "preparation_cpu_s": made.preparing.cpu_s,
        "seconds": made.solving.wall_s,
        "cpu_s": made.solving.cpu_s,
        "one_thread_cpu_ms_per_trial": made.one_thread_cpu_ms_per_trial,
        **{f"{name}_error": _noise_shares(value) for name, value in error.items()},
        "factor_once_cpu_s_per_trial": factoring.cpu_s,
        "ratio_cpu": factoring.cpu_s * len(contact) / made.solving.cpu_s,
        "peak_memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "load": os.getloadavg()[0],
    }


def neighbours(workers: int, apart_m: float = 0.045, force_n: float = 10.0) -> dict:
    """Error of the worst presses there are: every pair of neighbours, each with the largest force.

    In the 276 numbers, against the same mesh solved directly, of a 2 mV noise.
    """
    taxel = padded_sheet().taxel_m
    gap = np.hypot(*(taxel[:, None] - taxel).transpose(2, 0, 1))
    contact = taxel[np.argwhere(np.triu(gap < apart_m, 1))]
    force = np.full(contact.shape[:2], force_n)
    error = solver("fine", workers).pair_resistances(contact, force) - _direct("fine").pair_resistances(contact, force)
    shares = _noise_shares(error)
    return {
        "pairs": len(contact),
        "apart_m": apart_m,
        "force_n": force_n,
        "rms": shares["reciprocal"],
        "worst": shares["worst_reciprocal"],
    }


def contacts(count: int, trials: int = 300) -> dict:
    """CPU milliseconds a trial of several contacts anywhere on the sheet, solved on the fast and the fine mesh."""
    sensor, rng = padded_sheet(), np.random.default_rng(count)
    contact, force = rng.uniform(0.01, 0.11, (trials, count, 2)), rng.uniform(0.1, 10.0, (trials, count))
    result: dict = {"contacts": count}
    for name in ("fast", "fine"):
        sheet = PressedSheet(SheetModel(sensor, name), PRESSURE, LAW, CONTACT_OHM)
        sheet.pair_resistances(contact[:2], force[:2])
        with Stopwatch() as solving:
            sheet.pair_resistances(contact, force)
        result[name] = 1e3 * solving.cpu_s / trials
    return result


def _gap(contact_m: np.ndarray) -> np.ndarray:
    return np.hypot(*(contact_m[:, 0] - contact_m[:, 1]).T)


@cache
def _direct(resolution: str) -> PressedSheet:
    """Presses solved one by one over the whole sheet."""
    return PressedSheet(SheetModel(padded_sheet(), resolution), PRESSURE, LAW, CONTACT_OHM, tail=0.0)


def _noise_shares(error_ohm: np.ndarray) -> dict:
    """Rms error over a 2 mV noise in the readings, in the 276 numbers, and there in the worst trial."""
    whitened = PROTOCOL.whitened(error_ohm)
    worst = float(np.sqrt((whitened**2).mean(axis=1)).max())
    return {
        "readings": _rms(PROTOCOL.readings(error_ohm)) / NOISE_V,
        "reciprocal": _rms(whitened) / NOISE_V,
        "worst_reciprocal": worst / NOISE_V,
    }


def _rms(value: np.ndarray) -> float:
    return float(np.sqrt(np.mean(value**2)))
