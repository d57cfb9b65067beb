"""Contacts between the taxels, any number of them."""

import numpy as np
import pytest
import torch
from resistor_sheet import SIZE_M, mixed, protocol, taxel_m, trials

from ertskin.data.trials import joined
from ertskin.models.places import PlacesNetwork, counted, grid_spacing_m, nearest_contacts, on_taxels
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.noise import WhiteNoise
from ertskin.training.fit import fit
from ertskin.training.settings import TrainerSettings


def test_two_half_votes_for_one_place_are_one_contact_in_between():
    weight = np.array([0.5, 0.45, 0.02])
    place = np.array([[0.010, 0.0], [0.011, 0.0], [0.040, 0.0]])
    places, forces = counted(weight, np.array([4.0, 6.0, 9.0]), place, radius_m=0.005, threshold=0.5)
    assert places == pytest.approx(np.array([[0.01047, 0.0]]), abs=1e-5)
    assert forces == pytest.approx([(0.5 * 4 + 0.45 * 6) / 0.95])


def test_votes_for_places_apart_are_contacts_apart_and_weak_ones_are_none():
    weight = np.array([0.9, 0.8, 0.3])
    place = np.array([[0.0, 0.0], [0.03, 0.0], [0.06, 0.0]])
    places, forces = counted(weight, np.array([1.0, 2.0, 3.0]), place, radius_m=0.01, threshold=0.5)
    assert places[:, 0].tolist() == [0.0, 0.03]
    assert forces.tolist() == [1.0, 2.0]


def test_no_contact_at_all_is_an_empty_answer():
    nothing = counted(np.zeros(4), np.ones(4), np.zeros((4, 2)), radius_m=0.01, threshold=0.5)
    estimate = on_taxels([nothing, nothing], taxel_m())
    assert not estimate.present.any()
    assert estimate.contact_m.shape == (2, 0, 2)


def test_targets_name_the_nearest_contact_and_where_it_lies_from_the_taxel():
    pressed = trials(20, 2, seed=0, jitter_m=0.008)
    taxels = taxel_m()
    targets = nearest_contacts(pressed, taxels, reach_m=0.036)
    assert (targets["nearest"].sum(axis=1) == 2).all()
    frame, taxel = np.nonzero(targets["nearest"])
    place = taxels[taxel] + targets["offset"][frame, taxel]
    away = np.linalg.norm(place[:, None] - pressed.contact_m[frame], axis=-1).min(axis=1)
    assert away == pytest.approx(np.zeros(len(away)), abs=1e-12)
    assert (targets["force_n"][targets["in_reach"] == 0] == 0).all()


def test_the_spacing_of_a_grid_is_that_of_its_neighbours():
    assert grid_spacing_m(taxel_m()) == pytest.approx(SIZE_M / 3)


def test_it_learns_to_place_one_two_and_three_contacts_between_the_taxels(tmp_path):
    skin, noise = protocol(), WhiteNoise(protocol(), 1e-4)
    learned = joined([mixed(2000, 0, jitter_m=0.012), trials(1000, 3, 0, jitter_m=0.012)])
    torch.manual_seed(0)
    network = PlacesNetwork(28, taxel_m().tolist(), width=64)
    settings = TrainerSettings(max_epochs=20, patience=20, annealed=True, learning_rate=3e-3, accelerator="cpu")
    fit(network, network.prepare(skin, learned, noise, seed=0), settings, tmp_path)
    # Taxels are 30 mm apart: a contact's nearest one is 9 mm away on average.
    for contacts, right, away_m in ((1, 0.9, 0.0045), (2, 0.6, 0.006), (3, 0.3, 0.0075)):
        fresh = trials(200, contacts, seed=5, jitter_m=0.012)
        estimate = Reconstruction(skin, network).estimate_coordinates(fresh.coordinates_v(skin))
        counts = np.isfinite(estimate.contact_force_n).sum(axis=1)
        assert (counts == contacts).mean() > right
        apart_m = np.linalg.norm(estimate.contact_m[:, None] - fresh.contact_m[:, :, None], axis=-1)
        assert np.median(np.nan_to_num(apart_m, nan=np.inf).min(axis=2)) < away_m
