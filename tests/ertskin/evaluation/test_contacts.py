"""Metrics of touches anywhere against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.evaluation.contact_outcome import ContactOutcome, contacts_said
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.models.estimate import Estimate

NAN = np.nan
TAXEL_M = np.array([[0.0, 0.0], [0.1, 0.0]])


def test_contacts_are_assigned_by_least_distance_and_counted():
    true_m = np.array([[[0.0, 0.0], [0.1, 0.0]], [[0.0, 0.0], [NAN, NAN]]])
    true_n = np.array([[1.0, 2.0], [3.0, NAN]])
    said_m = np.array([[[0.101, 0.0], [0.002, 0.0]], [[0.0, 0.004], [0.09, 0.0]]])
    said_n = np.array([[2.5, 1.0], [3.0, 0.5]])
    scores = contact_scores(ContactOutcome(true_m, true_n, said_m, said_n, TAXEL_M))
    assert scores["count_rate_2"].value == 1.0
    assert scores["location_error_mm_2"].value == pytest.approx(1.5)
    assert scores["force_error_n_2"].value == pytest.approx(np.sqrt(0.25 / 2))
    assert scores["count_rate_1"].value == 0.0
    assert scores["invented_1"].value == 1.0
    assert scores["missed_1"].value == 0.0
    assert scores["location_error_mm_1"].value == pytest.approx(4.0)
    assert scores["location_error_mm_2"].per_taxel == pytest.approx([2.0, 1.0])
    assert "coverage_1" not in scores


def test_stated_regions_are_held_to_the_truth():
    rng = np.random.default_rng(0)
    true_m, true_n = np.zeros((4000, 1, 2)), np.ones((4000, 1))
    covariance = np.tile(np.diag([1e-6, 4e-6, 0.01]), (4000, 1, 1, 1))
    error = rng.standard_normal((4000, 3)) * np.sqrt([1e-6, 4e-6, 0.01])
    outcome = ContactOutcome(true_m, true_n, true_m + error[:, None, :2], true_n + error[:, 2:], TAXEL_M, covariance)
    assert contact_scores(outcome)["coverage_1"].value == pytest.approx(0.9, abs=0.015)


def test_a_network_of_taxels_says_its_taxels():
    estimate = Estimate(np.array([[0.0, 2.0]]), np.array([[False, True]]))
    place_m, force_n = contacts_said(estimate, TAXEL_M)
    assert place_m[0, 0] == pytest.approx([0.1, 0.0])
    assert force_n[0] == pytest.approx([2.0])
