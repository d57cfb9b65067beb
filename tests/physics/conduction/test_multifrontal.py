"""Multifrontal elimination against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from sheets import product_mesh

from ertskin.physics.conduction.dissection import dissect
from ertskin.physics.conduction.multifrontal import Fronts
from ertskin.physics.conduction.triangle import Space

ELECTRODES = 3


class Network:
    """A random resistor network on the nodes of a mesh, with leaks to three electrodes at some of them."""

    def __init__(self, degree: int, leaf_vertices: int) -> None:
        rng = np.random.default_rng(degree)
        mesh = product_mesh(np.sort(rng.random(9)), np.sort(rng.random(7)))
        space = Space.on(mesh.point_m, mesh.triangle, degree)
        self.nodes = space.nodes
        a, b = np.tril_indices(space.element.shape[1], -1)
        pair = np.unique(np.sort(np.stack([space.element[:, a], space.element[:, b]], axis=-1).reshape(-1, 2)), axis=0)
        leak = rng.choice(self.nodes, 12, replace=False)
        number = np.arange(self.nodes)
        self.row = np.concatenate([pair[:, 1], number, self.nodes + np.arange(12) % ELECTRODES])
        self.column = np.concatenate([pair[:, 0], number, leak])
        conductance, self.leak = rng.random(len(pair)), rng.random(12)
        self.fronts = Fronts.of(self.row, self.column, dissect(space, leaf_vertices), ELECTRODES)
        dense = np.zeros((self.nodes, self.nodes))
        np.add.at(dense, (pair[:, 0], pair[:, 1]), -conductance)
        dense += dense.T
        np.fill_diagonal(dense, -dense.sum(axis=1))
        dense[leak, leak] += self.leak
        self.dense = dense
        self.coupling = np.zeros((self.nodes, ELECTRODES))
        self.coupling[leak, np.arange(12) % ELECTRODES] = self.leak
        self.value = np.concatenate([-conductance, np.diag(dense), -self.leak])

    def ranked(self, value: np.ndarray) -> np.ndarray:
        ranked = np.empty_like(value)
        ranked[self.fronts.rank] = value
        return ranked


@pytest.mark.parametrize(("degree", "leaf"), [(1, 1), (1, 4), (2, 2), (3, 2), (4, 1), (2, 1000)])
def test_remainder_and_potentials_agree_with_dense_algebra(degree: int, leaf: int) -> None:
    network = Network(degree, leaf)
    factor = network.fronts.factor(network.ranked(network.value))
    potential = np.linalg.solve(network.dense, network.coupling)
    np.testing.assert_allclose(factor.potentials(), potential, atol=1e-12)
    np.testing.assert_allclose(factor.remainder, -network.coupling.T @ potential, atol=1e-12)
    right = np.random.default_rng(7).standard_normal((network.nodes, 5))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(network.dense, right), rtol=1e-9, atol=1e-9)


def test_eliminating_only_what_changed_gives_the_same() -> None:
    network = Network(2, 2)
    base = network.fronts.factor(network.ranked(network.value))
    stiffer = network.value.copy()
    first_diagonal = len(network.value) - 12 - network.nodes
    stiffer[first_diagonal + 5] += 3.0
    value = network.ranked(stiffer)
    dirty = network.fronts.affected(network.fronts.rank[[first_diagonal + 5]])
    assert 0 < dirty.sum() < len(dirty)
    again = network.fronts.refactor(network.fronts.entries_of(dirty, value), dirty, base)
    fresh = network.fronts.factor(value)
    np.testing.assert_array_equal(again.remainder, fresh.remainder)
    np.testing.assert_array_equal(again.potentials(), fresh.potentials())


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    network = Network(1, 4)
    with pytest.raises(np.linalg.LinAlgError):
        network.fronts.factor(network.ranked(-network.value))
