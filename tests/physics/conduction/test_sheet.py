"""The complete electrode model: reciprocity, scaling, derivatives, solving again, bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sheets import small_sheet, tank, wavy

from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.protocol import pair_resistances

RNG_SEED = 3
CONTACT = np.array([20.0, 50.0, 120.0, 300.0, 75.0])


def model_of(degree: int) -> SheetModel:
    return SheetModel(small_sheet(), Resolution(degree, Grading(cell_m=4e-3, rim_m=8e-4, growth=3.0)))


@pytest.fixture(scope="module", params=[1, 2, 3])
def model(request: pytest.FixtureRequest) -> SheetModel:
    return model_of(request.param)


@pytest.fixture(scope="module")
def wave(model: SheetModel) -> np.ndarray:
    return wavy(model.quadrature_m, 1e-3)


def test_reciprocal_and_passive(model: SheetModel, wave: np.ndarray) -> None:
    transfer = model.solve(wave, CONTACT).transfer_ohm
    np.testing.assert_array_equal(transfer, transfer.T)
    np.testing.assert_allclose(transfer.sum(axis=0), 0.0, atol=1e-9)
    assert np.linalg.eigvalsh(transfer)[1:].min() > 0
    assert (pair_resistances(transfer) > np.add.outer(CONTACT, CONTACT)[np.triu_indices(5, 1)]).all()


def test_transfer_is_the_energy_of_its_fields(model: SheetModel, wave: np.ndarray) -> None:
    """Reciprocity, from the fields themselves: T_ij is the power the fields of i and j dissipate together."""
    solution = model.solve(wave, CONTACT)
    field = solution.potential @ solution.transfer_ohm
    gradient = np.einsum("eqdn,enl->eqdl", model.space.gradients(), field[model.space.element])
    sheet = np.einsum("eq,eqdi,eqdj->ij", wave * model.weight_m2, gradient, gradient)
    loss = model.contact_losses(solution.potential) / (CONTACT * model.electrode_size)[:, None, None]
    contacts = solution.transfer_ohm @ loss.sum(axis=0) @ solution.transfer_ohm
    np.testing.assert_allclose(sheet + contacts, solution.transfer_ohm, atol=1e-9 * np.abs(solution.transfer_ohm).max())


def test_scaling_all_resistances_scales_the_pairs(model: SheetModel, wave: np.ndarray) -> None:
    once, scaled = model.solve(wave, CONTACT), model.solve(wave / 7, 7 * CONTACT)
    np.testing.assert_allclose(scaled.pair_resistance_ohm, 7 * once.pair_resistance_ohm, rtol=1e-11)


def test_isotropic_tensor_is_the_scalar(model: SheetModel, wave: np.ndarray) -> None:
    tensor = np.stack([wave, np.zeros_like(wave), wave], axis=-1)
    scalar = model.solve(wave, CONTACT).pair_resistance_ohm
    np.testing.assert_allclose(model.solve(tensor, CONTACT).pair_resistance_ohm, scalar, rtol=1e-12)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_tensor_against_a_sheet_of_other_coordinates(degree: int) -> None:
    """A linear map x -> A x turns a scalar sheet into one of conductivity A s A' / det A with the same resistances."""
    model = model_of(degree)
    turn = np.array([[1.3, 0.4], [-0.2, 0.8]])
    mapped = SheetModel.from_mesh(replace(model.mesh, point_m=model.mesh.point_m @ turn.T), degree)
    scalar = wavy(model.quadrature_m, 1e-3)
    metric = turn @ turn.T / np.linalg.det(turn)
    tensor = scalar[..., None] * metric[[0, 0, 1], [0, 1, 1]]
    expected = model.solve(scalar, CONTACT).pair_resistance_ohm
    np.testing.assert_allclose(mapped.solve(tensor, CONTACT).pair_resistance_ohm, expected, rtol=1e-11)


def central_difference(low: np.ndarray, high: np.ndarray, step: float) -> np.ndarray:
    return (high - low) / (2 * step)


def test_directional_derivative_against_differences(model: SheetModel, wave: np.ndarray) -> None:
    rng = np.random.default_rng(RNG_SEED)
    change = wave * rng.standard_normal((2, 3, *wave.shape)) * (wavy(model.quadrature_m, 1.0) > 1.8)
    solution, step = model.solve(wave, CONTACT), 1e-5
    directional = solution.directional(change)
    assert directional.shape == (2, 3, 10)
    for index in np.ndindex(2, 3):
        pairs = [model.solve(wave + s * change[index], CONTACT).pair_resistance_ohm for s in (-step, step)]
        np.testing.assert_allclose(directional[index], central_difference(*pairs, step), rtol=1e-6, atol=1e-4)


def test_jacobian_by_conductivity_is_the_directional_derivative(model: SheetModel, wave: np.ndarray) -> None:
    rng = np.random.default_rng(RNG_SEED)
    change = wave * rng.standard_normal(wave.shape)
    solution = model.solve(wave, CONTACT)
    product = solution.jacobian_conductivity().reshape(10, -1) @ change.ravel()
    np.testing.assert_allclose(product, solution.directional(change), rtol=1e-9)


def test_tensor_derivative_against_differences(model: SheetModel, wave: np.ndarray) -> None:
    rng = np.random.default_rng(RNG_SEED)
    tensor = np.stack([wave, 0.2 * wave, 0.7 * wave], axis=-1)
    change, step = wave[..., None] * rng.standard_normal(tensor.shape), 1e-5
    pairs = [model.solve(tensor + s * change, CONTACT).pair_resistance_ohm for s in (-step, step)]
    directional = model.solve(tensor, CONTACT).directional_tensor(change)
    np.testing.assert_allclose(directional, central_difference(*pairs, step), rtol=1e-6, atol=1e-4)


def test_jacobian_by_contact_resistance_against_differences(model: SheetModel, wave: np.ndarray) -> None:
    jacobian = model.solve(wave, CONTACT).jacobian_contact_resistance()
    for k in range(5):
        step = 1e-3 * np.eye(5)[k]
        pairs = [model.solve(wave, CONTACT + s * step).pair_resistance_ohm for s in (-1, 1)]
        np.testing.assert_allclose(jacobian[:, k], central_difference(*pairs, 1e-3), rtol=1e-6, atol=1e-7)


def test_derivatives_with_edge_electrodes() -> None:
    model = SheetModel(tank(), Resolution(2, Grading(cell_m=0.02, rim_m=2e-3)))
    wave, contact = wavy(model.quadrature_m, 1.0, 0.05), np.linspace(0.1, 2.0, 16)
    solution, change = model.solve(wave, contact), 0.1 * wave**2
    pairs = [model.solve(wave + s * change, contact + s).pair_resistance_ohm for s in (-1e-4, 1e-4)]
    expected = solution.directional(change) + solution.jacobian_contact_resistance().sum(axis=1)
    np.testing.assert_allclose(expected, central_difference(*pairs, 1e-4), rtol=1e-6)


def press(model: SheetModel, wave: np.ndarray, place: list[float]) -> np.ndarray:
    near = ((model.quadrature_m - place) ** 2).sum(axis=-1) < 0.003**2
    return np.where(near, 4 * wave, wave)


def test_solving_again_is_solving(model: SheetModel, wave: np.ndarray) -> None:
    base = model.solve(wave, CONTACT)
    first = model.solve_again(press(model, wave, [0.007, 0.011]), base)
    second = model.solve_again(press(model, wave, [0.021, 0.007]), first)
    for solution in (first, second):
        fresh = model.solve(solution.conductivity_s, CONTACT)
        np.testing.assert_allclose(solution.transfer_ohm, fresh.transfer_ohm, rtol=1e-11, atol=1e-10)
        np.testing.assert_allclose(solution.potential, fresh.potential, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(solution.directional(wave), fresh.directional(wave), rtol=1e-9)


def test_solving_again_with_a_tensor(model: SheetModel, wave: np.ndarray) -> None:
    tensor = wave[..., None] * [1.0, 0.1, 0.6]
    pressed = press(model, wave, [0.007, 0.011])[..., None] * [1.0, 0.1, 0.6]
    again = model.solve_again(pressed, model.solve(tensor, CONTACT))
    np.testing.assert_allclose(again.transfer_ohm, model.solve(pressed, CONTACT).transfer_ohm, rtol=1e-11, atol=1e-10)


def test_nodal_currents_of_an_electrode_give_its_field(model: SheetModel, wave: np.ndarray) -> None:
    load = np.zeros((model.space.nodes, 5))
    for k, contact in enumerate(model.contacts):
        load[contact.nodes, k] = contact.mass.sum(axis=1) / (CONTACT[k] * contact.size)
    field = model.contact_response(wave, CONTACT, load)
    np.testing.assert_allclose(field, model.solve(wave, CONTACT).potential, atol=1e-12)


def test_bad_input_is_refused(model: SheetModel, wave: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected"):
        model.solve(wave[1:], CONTACT)
    with pytest.raises(ValueError, match="positive"):
        model.solve(wave, -CONTACT)
    with pytest.raises(np.linalg.LinAlgError):
        model.solve(-wave, CONTACT)
    with pytest.raises(np.linalg.LinAlgError):
        model.solve(np.where(wave > 1.5e-3, np.nan, wave), CONTACT)
    with pytest.raises(ValueError, match="base"):
        model.solve_again(wave[..., None] * [1.0, 0.0, 1.0], model.solve(wave, CONTACT))
    with pytest.raises(KeyError):
        SheetModel(small_sheet(), "coarsest")


def test_other_contacts_on_the_same_sheet_are_solved_as_anew(model: SheetModel, wave: np.ndarray) -> None:
    base = model.solve(wave, CONTACT)
    other = CONTACT * np.array([0.2, 3.0, 1.0, 0.9, 40.0])
    anew, again = model.solve(wave, other), model.solve_contacts(other, base)
    np.testing.assert_allclose(again.pair_resistance_ohm, anew.pair_resistance_ohm, rtol=1e-11)
    np.testing.assert_allclose(again.potential, anew.potential, atol=1e-11)
    slope = anew.jacobian_contact_resistance()
    np.testing.assert_allclose(again.jacobian_contact_resistance(), slope, atol=1e-10 * np.abs(slope).max())
    assert model.solve_contacts(CONTACT, base) is base
    with pytest.raises(ValueError, match="positive"):
        model.solve_contacts(-CONTACT, base)
