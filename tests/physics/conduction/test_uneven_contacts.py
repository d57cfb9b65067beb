"""Contacts that conduct better on one side: against a dense assembly, the energy of their fields, differences."""

from __future__ import annotations

import numpy as np
import pytest
from sheets import small_sheet, tank, wavy

from ertskin.physics.conduction.contact import Contact
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel, transfer_of

CONTACT = np.array([20.0, 50.0, 120.0, 300.0, 75.0])
GRADING = Grading(cell_m=4e-3, rim_m=8e-4, growth=3.0)


@pytest.fixture(scope="module")
def model() -> SheetModel:
    return SheetModel(small_sheet(), Resolution(2, GRADING))


def uneven(model: SheetModel, size: float = 2.0) -> np.ndarray:
    """(C,) what the contacts' cells conduct over the mean, exponentially more on one side."""
    generator, found = np.random.default_rng(5), []
    for contact in model.contacts:
        across = (contact.center_m - contact.center_m.mean(axis=0)) @ generator.standard_normal(2)
        share = np.exp(size * across / np.abs(across).max())
        found.append(share / (share @ contact.cell_size / contact.size))
    return np.concatenate(found)


@pytest.fixture(scope="module")
def share(model: SheetModel) -> np.ndarray:
    return uneven(model)


def dense_conductance(model: SheetModel, conductance_s: float, per_area: list[np.ndarray]) -> np.ndarray:
    """(L,L) conductance between electrodes of linear triangles, each of a pad's with its own conductance per area."""
    point, nodes = model.mesh.point_m, len(model.mesh.point_m)
    matrix = np.zeros((nodes + model.electrodes, nodes + model.electrodes))
    for triangle in model.mesh.triangle:
        corner = np.column_stack([np.ones(3), point[triangle]])
        gradient = np.linalg.inv(corner)[1:]
        matrix[np.ix_(triangle, triangle)] += 0.5 * np.linalg.det(corner) * conductance_s * gradient.T @ gradient
    for k, conductances in enumerate(per_area):
        for triangle, each in zip(model.mesh.triangle[model.mesh.pad == k], conductances, strict=True):
            area = 0.5 * np.linalg.det(np.column_stack([np.ones(3), point[triangle]]))
            matrix[np.ix_(triangle, triangle)] += each * area / 12 * (1 + np.eye(3))
            matrix[triangle, nodes + k] -= each * area / 3
            matrix[nodes + k, triangle] -= each * area / 3
            matrix[nodes + k, nodes + k] += each * area
    inside, coupling = matrix[:nodes, :nodes], matrix[:nodes, nodes:]
    return np.asarray(matrix[nodes:, nodes:] - coupling.T @ np.linalg.solve(inside, coupling))


def test_uneven_contacts_are_as_in_a_dense_assembly() -> None:
    model = SheetModel(small_sheet(), Resolution(1, GRADING))
    share = uneven(model)
    per_area = [
        share[mine] / (ohm * contact.size)
        for contact, mine, ohm in zip(model.contacts, model.cells, CONTACT, strict=True)
    ]
    known = transfer_of(dense_conductance(model, 1e-3, per_area))
    found = model.solve(model.uniform(1e3), CONTACT, share).transfer_ohm
    np.testing.assert_allclose(found, known, atol=1e-9 * np.abs(known).max())
    even = model.solve(model.uniform(1e3), CONTACT).transfer_ohm
    assert np.abs(found - even).max() > 1e-3 * np.abs(known).max()


def test_cells_that_conduct_alike_are_an_even_contact(model: SheetModel) -> None:
    wave = wavy(model.quadrature_m, 1e-3)
    even, alike = model.solve(wave, CONTACT), np.ones(model.cells[-1].stop)
    np.testing.assert_allclose(
        model.solve(wave, CONTACT, alike).pair_resistance_ohm, even.pair_resistance_ohm, rtol=1e-12
    )


def test_transfer_is_the_energy_of_its_fields(model: SheetModel, share: np.ndarray) -> None:
    wave = wavy(model.quadrature_m, 1e-3)
    solution = model.solve(wave, CONTACT, share)
    field = solution.potential @ solution.transfer_ohm
    gradient = np.einsum("eqdn,enl->eqdl", model.space.gradients(), field[model.space.element])
    sheet = np.einsum("eq,eqdi,eqdj->ij", wave * model.weight_m2, gradient, gradient)
    loss = model.contact_losses(solution.potential, share) / (CONTACT * model.electrode_size)[:, None, None]
    contacts = solution.transfer_ohm @ loss.sum(axis=0) @ solution.transfer_ohm
    np.testing.assert_allclose(sheet + contacts, solution.transfer_ohm, atol=1e-9 * np.abs(solution.transfer_ohm).max())


@pytest.mark.parametrize("sensor", [small_sheet(), tank()], ids=["pads", "edges"])
def test_derivatives_against_differences(sensor) -> None:
    model = SheetModel(sensor, Resolution(2, GRADING))
    electrodes, share = model.electrodes, uneven(model, 0.5)
    ohm, sheet = np.linspace(20.0, 300.0, electrodes), model.uniform(1e3)
    solution = model.solve(sheet, ohm, share)
    by_lean = solution.jacobian_contact_lean(np.array([1, 3]))
    by_ohm = solution.jacobian_contact_resistance()
    for number, electrode in enumerate((1, 3)):
        for form, cells in enumerate(model.contacts[electrode].forms.T):
            step = np.zeros_like(share)
            step[model.cells[electrode]] = 1e-4 * cells
            more, less = (model.solve(sheet, ohm, share + s * step).pair_resistance_ohm for s in (1, -1))
            np.testing.assert_allclose(by_lean[:, number, form], (more - less) / 2e-4, rtol=1e-4, atol=1e-6)
        step = 1e-3 * np.eye(electrodes)[electrode]
        more, less = (model.solve(sheet, ohm + s * step, share).pair_resistance_ohm for s in (1, -1))
        np.testing.assert_allclose(by_ohm[:, electrode], (more - less) / 2e-3, rtol=1e-5, atol=1e-6)


def test_solving_again_keeps_uneven_contacts(model: SheetModel, share: np.ndarray) -> None:
    base = model.solve(model.uniform(1e3), CONTACT, share)
    pressed = model.uniform(1e3)
    pressed[:20] *= 3.0
    again = model.solve_again(pressed, base)
    np.testing.assert_allclose(
        again.pair_resistance_ohm, model.solve(pressed, CONTACT, share).pair_resistance_ohm, rtol=1e-10
    )
    np.testing.assert_allclose(
        again.jacobian_contact_resistance(),
        model.solve(pressed, CONTACT, share).jacobian_contact_resistance(),
        rtol=1e-8,
        atol=1e-10,
    )


def test_uneven_contacts_are_not_changed_alone(model: SheetModel, share: np.ndarray) -> None:
    base = model.solve(model.uniform(1e3), CONTACT, share)
    with pytest.raises(ValueError, match="uneven"):
        model.solve_contacts(2 * CONTACT, base)


@pytest.mark.parametrize("sensor", [small_sheet(), tank()], ids=["pads", "edges"])
def test_forms_are_orthogonal_to_one_another_and_to_an_even_contact(sensor) -> None:
    for contact in SheetModel(sensor, Resolution(1, GRADING)).contacts:
        weight = contact.cell_size / contact.size
        np.testing.assert_allclose(weight @ contact.forms, 0.0, atol=1e-12)
        gram = contact.forms.T @ (weight[:, None] * contact.forms)
        np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-10)


def test_a_share_of_second_degree_is_told_exactly(model: SheetModel) -> None:
    contact = model.contacts[0]
    x, y = 1e3 * (contact.center_m - contact.center_m.mean(axis=0)).T
    share = 7.0 * (1 + 0.05 * x - 0.03 * y + 0.02 * x * y + 0.01 * x**2)
    share /= share @ contact.cell_size / contact.size
    np.testing.assert_allclose(1 + contact.forms @ contact.lean(share), share, rtol=1e-9)


def test_too_few_cells_show_no_form_they_do_not_hold() -> None:
    cell, mass, size = np.array([[0, 1, 2], [1, 2, 3]]), np.ones((2, 3, 3)), np.array([1e-6, 1e-6])
    two = Contact(cell, mass, size, np.array([[0.0, 0.0], [1e-3, 0.0]]), is_pad=True)
    assert two.forms.shape == (2, 5)
    assert np.isfinite(two.forms).all()
    assert np.count_nonzero(np.abs(two.forms).max(axis=0)) == 1


def test_a_contact_of_one_cell_does_not_lean() -> None:
    for is_pad, nodes in ((True, 3), (False, 2)):
        one = Contact(np.arange(nodes)[None], np.ones((1, nodes, nodes)), np.array([1e-6]), np.zeros((1, 2)), is_pad)
        assert not one.forms.any()
        assert one.forms.shape == (1, one.form_count)
