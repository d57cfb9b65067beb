"""Shape functions, quadrature and numbering."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from sheets import product_mesh

from ertskin.physics.conduction.triangle import Space, edge_mass, lattice, quadrature, shape_functions, shape_slopes

DEGREES = [1, 2, 3, 4]


@pytest.mark.parametrize("degree", DEGREES)
def test_shape_functions_are_one_at_their_own_node(degree: int) -> None:
    np.testing.assert_allclose(
        shape_functions(degree, lattice(degree) / degree), np.eye(len(lattice(degree))), atol=1e-12
    )


@pytest.mark.parametrize("degree", DEGREES)
def test_slopes_are_derivatives(degree: int) -> None:
    point, step = np.array([[0.2, 0.3, 0.5], [0.1, 0.7, 0.2]]), 1e-6
    for k in range(3):
        moved = step * np.eye(3)[k]
        difference = shape_functions(degree, point + moved) - shape_functions(degree, point - moved)
        np.testing.assert_allclose(shape_slopes(degree, point)[..., k], difference / (2 * step), atol=1e-8)


@pytest.mark.parametrize("order", range(1, 9))
def test_quadrature_is_exact_to_its_order(order: int) -> None:
    barycentric, weight = quadrature(2, order)
    for i in range(order + 1):
        for j in range(order + 1 - i):
            exact = 2 * factorial(i) * factorial(j) / factorial(i + j + 2)
            assert weight @ (barycentric[:, 1] ** i * barycentric[:, 2] ** j) == pytest.approx(exact, rel=1e-12)


def test_edge_mass_of_first_and_second_order() -> None:
    np.testing.assert_allclose(edge_mass(1), np.array([[2, 1], [1, 2]]) / 6, atol=1e-15)
    np.testing.assert_allclose(edge_mass(2), np.array([[4, -1, 2], [-1, 4, 2], [2, 2, 16]]) / 30, atol=1e-15)


@pytest.mark.parametrize("degree", DEGREES)
def test_neighbours_share_the_nodes_of_their_side(degree: int) -> None:
    mesh = product_mesh(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.5, 2.0]))
    space = Space.on(mesh.point_m, mesh.triangle, degree)
    assert len(np.unique(space.node_m.round(9), axis=0)) == space.nodes == (2 * degree + 1) ** 2


@pytest.mark.parametrize("degree", DEGREES)
def test_edge_nodes_lie_on_the_edge_in_order(degree: int) -> None:
    mesh = product_mesh(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.5, 2.0]))
    space = Space.on(mesh.point_m, mesh.triangle, degree)
    first, second, *between = space.edge_nodes(mesh.edge[0]).T
    share = np.arange(1, degree)[:, None, None] / degree
    expected = (1 - share) * space.node_m[first] + share * space.node_m[second]
    np.testing.assert_allclose(space.node_m[np.array(between, dtype=int)].reshape(expected.shape), expected, atol=1e-12)


@pytest.mark.parametrize("degree", DEGREES)
def test_gradients_of_a_polynomial(degree: int) -> None:
    mesh = product_mesh(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.5, 2.0]))
    space = Space.on(mesh.point_m, mesh.triangle, degree)
    x, y = space.node_m.T
    value = (x + 2 * y) ** degree
    gradient = np.einsum("eqdn,en->eqd", space.gradients(), value[space.element])
    at = space.quadrature_m() @ [1.0, 2.0]
    np.testing.assert_allclose(gradient[..., 0], degree * at ** (degree - 1), rtol=1e-9)
    np.testing.assert_allclose(gradient[..., 1], 2 * degree * at ** (degree - 1), rtol=1e-9)
