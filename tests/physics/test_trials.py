"""The paper's trial counts, and independence of how they are cut into shards."""

import numpy as np
import pytest

from ertskin.physics.sensor import taxel_grid_m
from ertskin.physics.trials import many_point, one_point

GRID = taxel_grid_m((0.12, 0.12), 6, 6)


def test_one_point_counts_and_steps():
    trials = one_point(GRID)
    assert len(trials) == 3600
    assert np.allclose(np.unique(trials.force_n), np.arange(1, 101) / 10)
    assert np.array_equal(trials.contact_m[:, 0], GRID[trials.taxel[:, 0]])


def test_two_points_are_different_taxels_with_forces_in_range():
    trials = many_point(GRID, 500, seed=3)
    assert (trials.taxel[:, 0] != trials.taxel[:, 1]).all()
    assert trials.force_n.min() >= 0.1
    assert trials.force_n.max() <= 10
    assert np.allclose(trials.force_map_n(36).sum(axis=1), trials.force_n.sum(axis=1))


def test_shards_draw_what_the_whole_draws():
    whole = many_point(GRID, 40, seed=7, jitter_m=1e-3)
    part = many_point(GRID, 15, seed=7, jitter_m=1e-3, first=25)
    assert np.array_equal(whole.contact_m[25:], part.contact_m)
    assert np.array_equal(whole.force_n[25:], part.force_n)
    assert not np.array_equal(whole.force_n[:15], part.force_n)


def test_more_contacts_than_taxels_is_refused():
    with pytest.raises(ValueError, match="3 contacts"):
        many_point(GRID[:2], 1, contacts=3)
