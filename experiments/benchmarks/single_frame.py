"""One frame with a new conductivity: every reading of the full pattern, and the Jacobian."""

from __future__ import annotations

import numpy as np
from contestants import FactorOnce, Ours, PointSciPy, PyEIT
from sheets import CELL_M, middle_nodes, random_conductivity, tank_mesh
from stopwatch import paired_seconds, summary

from ertskin.physics.protocol import Protocol, electrode_pairs

AGREEMENT = 1e-9


def frame(nodes: int, turns: int, with_pyeit: bool) -> dict:
    """Times of one frame on a tank of about ``nodes`` nodes with 24 electrodes; raises if the answers differ."""
    mesh = tank_mesh(CELL_M[nodes])
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1.0)
    contact = np.linspace(0.1, 1.0, 24)
    ours, factor_once = Ours(mesh, 1, contact, protocol), FactorOnce(mesh, 1, contact, protocol)
    conductivity = [random_conductivity(mesh, 1, seed) for seed in range(turns + 1)]
    agree(ours.readings(conductivity[0]), factor_once.readings(conductivity[0]))
    jobs = {
        "ertskin": cycling(ours.readings, conductivity),
        factor_once.name: cycling(factor_once.readings, conductivity),
    }
    times = summary(paired_seconds(jobs, turns), "ertskin")
    result = {"nodes": len(mesh.point_m), "elements": len(mesh.triangle), **{n: v for n, v in times.items()}}
    if with_pyeit:
        node = middle_nodes(mesh)
        theirs = PyEIT(mesh, node)
        agree(theirs.readings(conductivity[0]), PointSciPy(mesh, node).readings(conductivity[0]))
        jobs = {"ertskin": jobs["ertskin"], "pyEIT": cycling(theirs.readings, conductivity)}
        result["pyEIT"] = summary(paired_seconds(jobs, 3), "ertskin")["pyEIT"]
    return result


def jacobian(nodes: int, turns: int) -> dict:
    """Times of the derivative of the 276 pair resistances by every element's conductivity."""
    mesh = tank_mesh(CELL_M[nodes])
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1.0)
    contact = np.linspace(0.1, 1.0, 24)
    ours, factor_once = Ours(mesh, 1, contact, protocol), FactorOnce(mesh, 1, contact, protocol)
    conductivity = [random_conductivity(mesh, 1, seed) for seed in range(turns + 1)]
    agree(ours.jacobian(conductivity[0]), factor_once.jacobian(conductivity[0]))
    jobs = {
        "ertskin": cycling(ours.jacobian, conductivity),
        factor_once.name: cycling(factor_once.jacobian, conductivity),
    }
    return {"nodes": len(mesh.point_m), **summary(paired_seconds(jobs, turns), "ertskin")}


def electrodes(count: int, turns: int) -> dict:
    """Times of one frame at about 10,000 nodes for another number of electrodes, all pairs driven."""
    mesh = tank_mesh(CELL_M[10_000], count)
    protocol = Protocol.against_sink(electrode_pairs(count), count, 1.0)
    contact = np.linspace(0.1, 1.0, count)
    ours, factor_once = Ours(mesh, 1, contact, protocol), FactorOnce(mesh, 1, contact, protocol)
    conductivity = [random_conductivity(mesh, 1, seed) for seed in range(turns + 1)]
    agree(ours.readings(conductivity[0]), factor_once.readings(conductivity[0]))
    jobs = {
        "ertskin": cycling(ours.readings, conductivity),
        factor_once.name: cycling(factor_once.readings, conductivity),
    }
    return {"electrodes": count, "nodes": len(mesh.point_m), **summary(paired_seconds(jobs, turns), "ertskin")}


def agree(ours: np.ndarray, theirs: np.ndarray) -> None:
    """Raise ``AssertionError`` unless two answers are the same to 1e-9 of the largest."""
    worst = np.abs(ours - theirs).max() / np.abs(theirs).max()
    if worst > AGREEMENT:
        raise AssertionError(f"the solvers differ by {worst:.1e} of the largest value")


def cycling(job, conductivities):
    """The job on the next conductivity at every call."""
    state = iter(range(10**9))
    return lambda: job(conductivities[next(state) % len(conductivities)])
