"""The generator's complete electrode model: closed forms, energy, reciprocity, refinement, substructuring."""

from __future__ import annotations

import numpy as np
import pytest
from generator.mesh import Fineness
from generator.sheet import Electrodes, Sheet
from generator.skins import SHAPES, _sheet
from generator.tiles import Tiles
from small_proof_skin import COARSE, small_skin

STRIP = np.array([[0.0, 0.0], [0.08, 0.0], [0.08, 0.03], [0.0, 0.03]])
ENDS = np.array([[[0.0, 0.03], [0.0, 0.0]], [[0.08, 0.0], [0.08, 0.03]]])


def electric(sheet: Sheet, sheet_ohm: float, contact_ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    specific = 1.0 / (contact_ohm * sheet.electrodes.extent)
    admittance = np.zeros(sheet.weight.shape)
    admittance[sheet.pad >= 0] = specific[sheet.pad[sheet.pad >= 0]][:, None]
    return np.full(sheet.weight.shape, 1.0 / sheet_ohm), admittance, specific


@pytest.mark.parametrize("along", [1.0, 2.5])
def test_a_strip_is_its_length_over_its_width(along: float) -> None:
    sheet = Sheet(STRIP, Electrodes(edge_m=ENDS), Fineness(3e-3, 3e-3, 1e-3))
    conductance, admittance, edge = electric(sheet, 1e3, np.array([40.0, 70.0]))
    tensor = conductance[..., None, None] * np.diag([along, 1.0 / along])
    t = sheet.transfer(tensor, admittance, edge)
    assert t[0, 0] + t[1, 1] - 2 * t[0, 1] == pytest.approx(1e3 * 0.08 / 0.03 / along + 110.0, rel=1e-9)


def test_transfer_is_symmetric_mean_free_and_its_power_is_dissipated() -> None:
    skin = small_skin()
    sheet = Sheet(skin.outline_m, skin.electrodes, COARSE)
    state = electric(sheet, skin.sheet_ohm, skin.contact_ohm)
    _, per_volt = sheet.reduced(*state)
    transfer = sheet.transfer(*state)
    np.testing.assert_allclose(transfer, transfer.T, atol=1e-9)
    np.testing.assert_allclose(transfer.sum(axis=0), 0.0, atol=1e-6)
    current = np.array([1.0, 0, -1, 0, 0, 0, 0, 0])
    volt = transfer @ current
    potential = per_volt @ volt
    flow = np.einsum("eqad,ea->eqd", sheet.gradient, potential[sheet.dofs])
    heat = np.sum((flow**2).sum(axis=2) * state[0] * sheet.weight)
    jump = (
        np.einsum("eqa,ea->eq", sheet.shape, potential[sheet.dofs])
        - np.where(sheet.pad >= 0, volt[sheet.pad], 0)[:, None]
    )
    assert heat + np.sum(state[1] * jump**2 * sheet.weight) == pytest.approx(volt @ current, rel=1e-9)


def test_refinement_leaves_little_beside_the_noise() -> None:
    skin = small_skin()
    found = []
    for fineness in (skin.fineness, Fineness(2.6e-3, 4.5e-4), Fineness(1.5e-3, 2.2e-4)):
        sheet = Sheet(skin.outline_m, skin.electrodes, fineness)
        found.append(sheet.transfer(*electric(sheet, skin.sheet_ohm, skin.contact_ohm)))
    coarse, fine = (np.abs(t - found[-1]).max() * skin.protocol.current_a for t in found[:2])
    assert fine < 2e-4 < 2e-3
    assert fine < coarse / 3


def test_pressed_tiles_alone_give_what_the_whole_sheet_gives() -> None:
    skin = small_skin()
    sheet = Sheet(skin.outline_m, skin.electrodes, COARSE)
    tiles = Tiles(sheet)
    rest = electric(sheet, skin.sheet_ohm, skin.contact_ohm)
    region = tiles.region(tiles.within(np.array([[0.05, 0.014]]), 0.01))
    conductance, admittance = rest[0].copy(), rest[1].copy()
    conductance[region.elements] *= 3.0
    admittance[region.elements] *= 5.0
    e = region.elements
    found = region.transfer(region.outside(tiles.condense(rest)), conductance[e], admittance[e], rest[2])
    np.testing.assert_allclose(found, sheet.transfer(conductance, admittance, rest[2]), atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_meshed_to_its_area_and_pads(shape: str) -> None:
    outline, electrodes, taxels = _sheet(shape)
    sheet = Sheet(outline, electrodes, Fineness(5e-3, 2e-3, 4e-4))
    x, y = outline.T
    assert sheet.weight.sum() == pytest.approx(0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)), rel=1e-9)
    if electrodes.edge_m is None:
        area = np.bincount(sheet.pad[sheet.pad >= 0], sheet.weight[sheet.pad >= 0].sum(axis=1))
    else:
        area = np.bincount(sheet.edge_owner, sheet.edge_weight.sum(axis=1))
    np.testing.assert_allclose(area, electrodes.extent, rtol=1e-9)
    assert len(taxels) >= 12
