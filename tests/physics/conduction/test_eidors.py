"""Against EIDORS' forward solutions: linear triangles, complete electrode model, electrodes on the outline."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from ertskin.physics.conduction.mesh import SheetMesh
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs


@pytest.mark.parametrize("name", ["eidors_m2500.h5", "eidors_m10k.h5"])
def test_agrees_with_eidors(shared_data: Path, name: str) -> None:
    with h5py.File(shared_data / "real" / name) as file:
        point, triangle = file["node"][:], file["triangle"][:].astype(np.intp)
        nodes = [file["electrode"][key][:] for key in sorted(file["electrode"])]
        impedance = float(np.ravel(file.attrs["contact_impedance"])[0])
        conductivity, expected = file["conductivity"][:], file["voltage"][:]
    mesh = SheetMesh.from_nodes(point, triangle, nodes)
    model = SheetModel.from_mesh(mesh, degree=1)
    solution = model.solve(conductivity[:, None], impedance / model.electrode_size)

    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1.0)
    ours = protocol.readings(solution.pair_resistance_ohm)
    theirs = expected - np.take_along_axis(expected, electrode_pairs(24)[:, 1:], axis=1)
    np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max(), rtol=0)
