"""The paper's 36,000 trials: 36 places x 100 forces of one contact, 32,400 random pairs."""

from __future__ import annotations

import os
import resource

import numpy as np
from contestants import FactorOnce
from sheets import IndenterPressure, SaturatingLaw, padded_sheet
from single_frame import agree
from stopwatch import Stopwatch

from physics.conduction.pressed_sheet import PressedSheet
from physics.conduction.sheet import SheetModel
from physics.conduction.trials import TrialSolver
from physics.protocol import Protocol, electrode_pairs

NOISE_V = 2e-3
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


def run(pairs: int, workers: int) -> dict:
    """Times, memory and error against the fine mesh, and the plain solver's time on that mesh."""
    sensor, pressure, law = padded_sheet(), IndenterPressure(), SaturatingLaw()
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    contact, force = presses(pairs)
    with Stopwatch() as preparing:
        solver = TrialSolver.of(sensor, pressure, law, CONTACT_OHM, sensor.taxel_m, 10.0, workers=workers)
    solver.pair_resistances(contact[3600:3700], force[3600:3700], workers)
    every = slice(None, None, 9)
    with Stopwatch() as alone:
        solver.pair_resistances(contact[every], force[every])
    with Stopwatch() as solving:
        pair_ohm = solver.pair_resistances(contact, force, workers)

    fine = PressedSheet(SheetModel(sensor, "fine"), pressure, law, CONTACT_OHM, tail=0.0)
    checked = np.random.default_rng(1).choice(len(contact), CHECKED, replace=False)
    checked[:4] = 3600 + np.flatnonzero(_gap(contact[3600:]) < 0.021)[:4]
    error = pair_ohm[checked] - fine.pair_resistances(contact[checked], force[checked])
    one = fine.solve(contact[checked[0]], force[checked[0]])
    plain = FactorOnce(fine.sheet.mesh, fine.sheet.space.degree, CONTACT_OHM, protocol)
    with Stopwatch() as factoring:
        theirs = plain.pair_resistances(one.conductivity_s)
    agree(one.pair_resistance_ohm, theirs)
    return {
        "trials": len(contact),
        "workers": workers,
        "preparation_s": preparing.wall_s,
        "preparation_cpu_s": preparing.cpu_s,
        "seconds": solving.wall_s,
        "cpu_s": solving.cpu_s,
        "one_thread_cpu_ms_per_trial": 1e3 * alone.cpu_s / len(contact[every]),
        "nodes": fine.sheet.space.nodes,
        "reading_error": _rms(protocol.readings(error)) / NOISE_V,
        "reciprocal_error": _rms(protocol.whitened(error)) / NOISE_V,
        "worst_reciprocal_error": float(np.sqrt((protocol.whitened(error) ** 2).mean(axis=1)).max()) / NOISE_V,
        "factor_once_cpu_s_per_trial": factoring.cpu_s,
        "ratio_cpu": factoring.cpu_s * len(contact) / solving.cpu_s,
        "peak_memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "load": os.getloadavg()[0],
    }


def contacts(count: int, trials: int = 300) -> dict:
    """CPU milliseconds a trial of several contacts anywhere on the sheet, solved on the fast and the fine mesh."""
    sensor, rng = padded_sheet(), np.random.default_rng(count)
    contact, force = rng.uniform(0.01, 0.11, (trials, count, 2)), rng.uniform(0.1, 10.0, (trials, count))
    result: dict = {"contacts": count}
    for name in ("fast", "fine"):
        sheet = PressedSheet(SheetModel(sensor, name), IndenterPressure(), SaturatingLaw(), CONTACT_OHM)
        sheet.pair_resistances(contact[:2], force[:2])
        with Stopwatch() as solving:
            sheet.pair_resistances(contact, force)
        result[name] = 1e3 * solving.cpu_s / trials
    return result


def _gap(contact_m: np.ndarray) -> np.ndarray:
    return np.hypot(*(contact_m[:, 0] - contact_m[:, 1]).T)


def _rms(value: np.ndarray) -> float:
    return float(np.sqrt(np.mean(value**2)))
