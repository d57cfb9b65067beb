"""How the forward model scales towards a whole-body skin: more electrodes on a larger sheet of the same fineness.

    python experiments/benchmarks/whole_body.py

A square sheet with 22 mm between pads, as the paper's; first-order triangles of 5 mm. For each size: unknowns, CPU
milliseconds of a whole solve, of a press solved in part, of the transfer matrix, and the memory of the factor.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import json  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from stopwatch import Stopwatch  # noqa: E402

from ertskin.physics.conduction.mesh import Grading  # noqa: E402
from ertskin.physics.conduction.sheet import Resolution, SheetModel  # noqa: E402
from ertskin.physics.sensor import Sensor, rectangle_m  # noqa: E402

PITCH_M = 0.022
SIDES = (5, 8, 11, 16, 23, 32)


def measure(side: int) -> dict:
    """One sheet of ``side`` x ``side`` pads."""
    line = (np.arange(side) + 0.5) * PITCH_M
    center = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    size = side * PITCH_M
    sensor = Sensor(rectangle_m((size, size)), 18_000.0, 100.0, center, np.full((side**2, 2), 0.004))
    with Stopwatch() as building:
        model = SheetModel(sensor, Resolution(1, Grading(cell_m=5e-3, rim_m=1e-3, growth=3.0)))
    conductivity = model.uniform(18_000.0)
    base = model.solve(conductivity, 100.0)
    pressed = conductivity.copy()
    pressed[((model.quadrature_m - 0.5 * size) ** 2).sum(axis=2) < 0.01**2] *= 3
    with Stopwatch() as solving:
        model.solve(conductivity, 100.0)
    with Stopwatch() as again:
        part = model.solve_again(pressed, base)
    with Stopwatch() as inverting:
        assert part.transfer_ohm.shape == (side**2, side**2)
    return {
        "electrodes": side**2,
        "sheet_m": size,
        "unknowns": model.space.nodes,
        "build_cpu_s": building.cpu_s,
        "solve_ms": 1e3 * solving.cpu_s,
        "press_ms": 1e3 * again.cpu_s,
        "transfer_ms": 1e3 * inverting.cpu_s,
        "factor_mb": base.factor.work.nbytes / 1e6,
    }


def main() -> None:
    """Measure all sizes and write whole_body.json."""
    measure(SIDES[0])
    results = []
    for side in SIDES:
        results.append(measure(side))
        print(json.dumps(results[-1]), flush=True)
    (Path(__file__).resolve().parent / "whole_body.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
