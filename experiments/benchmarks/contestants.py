"""The forward models compared: ours, a plain SciPy solver that factors once, and pyEIT, all on one mesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from ertskin.physics.conduction.mesh import SheetMesh
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances

Array = np.ndarray


class Ours:
    """``SheetModel``: multifrontal elimination down to the electrodes, readings from the transfer matrix."""

    name = "ertskin"

    def __init__(self, mesh: SheetMesh, degree: int, contact_ohm: Array, protocol: Protocol) -> None:
        self.model, self.contact_ohm, self.protocol = SheetModel.from_mesh(mesh, degree), contact_ohm, protocol

    def readings(self, conductivity_s: Array) -> Array:
        """(K,M) volt for a conductivity (E,Q)."""
        return self.protocol.readings(self.model.solve(conductivity_s, self.contact_ohm).pair_resistance_ohm)

    def jacobian(self, conductivity_s: Array) -> Array:
        """(P,E,Q) derivative of the pair resistances."""
        return self.model.solve(conductivity_s, self.contact_ohm).jacobian_conductivity()


class FactorOnce:
    """Triplets to a sparse matrix, one SuperLU factorisation with its defaults, L-1 right-hand sides."""

    name = "SciPy, factor once"

    def __init__(self, mesh: SheetMesh, degree: int, contact_ohm: Array, protocol: Protocol) -> None:
        model = SheetModel.from_mesh(mesh, degree)
        self.space, self.protocol, self.weight_m2 = model.space, protocol, model.weight_m2
        gradient = self.space.gradients()
        self.local = np.einsum("eq,eqda,eqdb->eqab", model.weight_m2, gradient, gradient)
        nodes, electrodes = self.space.nodes, mesh.electrodes
        rows, columns, values = [], [], []
        for k, contact in enumerate(model.contacts):
            per_size = 1.0 / (contact_ohm[k] * contact.size)
            a, b = np.meshgrid(contact.nodes, contact.nodes, indexing="ij")
            touch = -contact.mass.sum(axis=1) * per_size
            electrode = np.full(len(contact.nodes), nodes + k)
            rows += [a.ravel(), contact.nodes, electrode, [nodes + k]]
            columns += [b.ravel(), electrode, contact.nodes, [nodes + k]]
            values += [contact.mass.ravel() * per_size, touch, touch, [1.0 / contact_ohm[k]]]
        n = self.space.element.shape[1]
        self.row = np.concatenate([np.repeat(self.space.element, n, axis=1).ravel(), *rows])
        self.column = np.concatenate([np.tile(self.space.element, n).ravel(), *columns])
        self.fixed = np.concatenate(values)
        # The last electrode is the ground.
        self.kept = (self.row < nodes + electrodes - 1) & (self.column < nodes + electrodes - 1)
        self.size = nodes + electrodes - 1
        self.right = np.zeros((self.size, electrodes - 1))
        self.right[nodes:] = np.eye(electrodes - 1)

    def potentials(self, conductivity_s: Array) -> Array:
        """(N+L-1, L-1) potentials per ampere into each electrode but the last and out of the last."""
        value = np.concatenate([np.einsum("eq,eqab->eab", conductivity_s, self.local).ravel(), self.fixed])
        kept = self.kept
        shape = (self.size, self.size)
        matrix = coo_array((value[kept], (self.row[kept], self.column[kept])), shape=shape).tocsc()
        return splu(matrix).solve(self.right)

    def pair_resistances(self, conductivity_s: Array) -> Array:
        """(P,) ohm."""
        electrodes = self.right.shape[1] + 1
        transfer = np.zeros((electrodes, electrodes))
        transfer[:-1, :-1] = self.potentials(conductivity_s)[self.space.nodes :]
        return pair_resistances(transfer)

    def readings(self, conductivity_s: Array) -> Array:
        """(K,M) volt for a conductivity (E,Q)."""
        return self.protocol.readings(self.pair_resistances(conductivity_s))

    def jacobian(self, conductivity_s: Array) -> Array:
        """(P,E,Q) derivative of the pair resistances, by the adjoint in plain NumPy."""
        potential = np.zeros((self.space.nodes, self.right.shape[1] + 1))
        potential[:, :-1] = self.potentials(conductivity_s)[: self.space.nodes]
        field = np.einsum("eqdn,enl->eqdl", self.space.gradients(), potential[self.space.element])
        i, j = np.triu_indices(potential.shape[1], 1)
        loss = ((field[..., i] - field[..., j]) ** 2).sum(axis=2) * self.weight_m2[..., None]
        return -np.moveaxis(loss, -1, 0)


class PointSciPy:
    """Point electrodes at single nodes, factored once: what pyEIT's answers are checked against."""

    def __init__(self, mesh: SheetMesh, node: Array) -> None:
        model = SheetModel.from_mesh(mesh, 1)
        self.space, self.weight_m2, self.node = model.space, model.weight_m2, node

    def readings(self, conductivity_s: Array) -> Array:
        """(K,L) volt against the sink for one ampere between each pair."""
        gradient = self.space.gradients()
        local = np.einsum("eq,eqda,eqdb->eab", conductivity_s * self.weight_m2, gradient, gradient)
        row, column = np.repeat(self.space.element, 3, axis=1).ravel(), np.tile(self.space.element, 3).ravel()
        kept = (row > 0) & (column > 0)
        size = self.space.nodes - 1
        matrix = coo_array((local.ravel()[kept], (row[kept] - 1, column[kept] - 1)), shape=(size, size)).tocsc()
        right = np.zeros((size, len(self.node)))
        right[self.node - 1, np.arange(len(self.node))] = 1.0
        transfer = splu(matrix).solve(right)[self.node - 1]
        electrodes = len(self.node)
        protocol = Protocol.against_sink(electrode_pairs(electrodes), electrodes, 1.0)
        return protocol.readings(pair_resistances(transfer))


class PyEIT:
    """pyEIT 1.2: point electrodes only, one sparse solve from scratch for every injection."""

    name = "pyEIT"

    def __init__(self, mesh: SheetMesh, node: Array) -> None:
        from pyeit.eit.fem import EITForward
        from pyeit.eit.protocol import PyEITProtocol
        from pyeit.mesh import PyEITMesh

        electrodes = len(node)
        pairs = electrode_pairs(electrodes)
        against_sink = np.stack([np.stack([np.arange(electrodes), np.full(electrodes, b)], axis=1) for _, b in pairs])
        point = np.column_stack([mesh.point_m, np.zeros(len(mesh.point_m))])
        grid = PyEITMesh(node=point, element=mesh.triangle, perm=1.0, el_pos=node, ref_node=0)
        keep = np.ones(against_sink.shape[:2], dtype=bool).ravel()
        self.forward = EITForward(grid, PyEITProtocol(pairs, against_sink, keep))
        self.pairs = pairs

    def readings(self, conductivity_s: Array) -> Array:
        """(K,L) volt against the sink for one ampere between each pair."""
        return self.forward.solve_eit(conductivity_s[:, 0]).reshape(len(self.pairs), -1)
