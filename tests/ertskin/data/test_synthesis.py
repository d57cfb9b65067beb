"""Trials come out the same however they were computed, and the paper's counts are the defaults."""

import numpy as np
import pytest

from ertskin.cluster import LocalCluster
from ertskin.data.synthesis import Plan, synthesize
from ertskin.physics.sensor import taxel_grid_m

GRID = taxel_grid_m((0.06, 0.06), 3, 3)
PLAN = Plan(steps=5, trials=70, denoiser_trials=20, shard=30)


class Bowl:
    """A forward model that is quick and different for every press."""

    def change_ohm(self, contact_m, force_n):
        force = np.nan_to_num(force_n)
        place = np.nan_to_num(contact_m)
        return np.stack([force.sum(axis=1), (force * place[..., 0]).sum(axis=1), (force**2).sum(axis=1)], axis=1)


class Interrupted(Bowl):
    """Dies after two shards."""

    def __init__(self):
        self.calls = 0

    def change_ohm(self, contact_m, force_n):
        self.calls += 1
        if self.calls > 2:
            raise KeyboardInterrupt
        return super().change_ohm(contact_m, force_n)


def made(folder, forward=Bowl, workers=1, plan=PLAN):
    return synthesize(folder, {"skin": "bowl"}, plan, GRID, forward, LocalCluster(workers))


def test_the_papers_counts_are_the_defaults():
    network, denoiser = Plan().presses(taxel_grid_m((0.12, 0.12), 6, 6))
    assert (len(network), len(denoiser)) == (36_000, 1800)
    assert np.isfinite(network.force_n).sum() == 3600 + 2 * 32_400
    assert not np.array_equal(network.force_n[3600:5400], denoiser.force_n)


def test_one_or_two_workers_and_a_cut_give_the_same_bits(tmp_path):
    network, denoiser, checksum = made(tmp_path / "one")
    assert made(tmp_path / "two", workers=2)[2] == checksum
    with pytest.raises(KeyboardInterrupt):
        made(tmp_path / "cut", forward=Interrupted)
    steps = []
    assert (
        synthesize(
            tmp_path / "cut", {"skin": "bowl"}, PLAN, GRID, Bowl, LocalCluster(1), lambda *step: steps.append(step)
        )[2]
        == checksum
    )
    assert steps == [(2, 5), (3, 5), (4, 5), (5, 5)]
    assert (len(network), len(denoiser)) == (3 * 3 * 5 + 70, 20)


def test_what_is_there_is_only_read(tmp_path):
    first = made(tmp_path)

    def forward():
        raise AssertionError("nothing is missing")

    again = made(tmp_path, forward=forward)
    assert again[2] == first[2]
    assert np.array_equal(again[0].change_ohm, first[0].change_ohm)


def test_changes_belong_to_their_labels(tmp_path):
    network, _, _ = made(tmp_path)
    assert network.change_ohm[:, 0] == pytest.approx(network.force_map_n.sum(axis=1))
    assert (network.contacts == np.r_[np.ones(45), np.full(70, 2)]).all()


def test_another_seed_gives_other_trials(tmp_path):
    other = Plan(**{**vars(PLAN), "seed": 1})
    assert made(tmp_path / "a")[2] != made(tmp_path / "b", plan=other)[2]
