"""The metrics against independent references: plain loops, scipy, scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from sklearn.metrics import accuracy_score, mean_squared_error

from ertskin.evaluation.metrics import (
    exact_rate_two,
    force_correlation_one,
    force_error_two_n,
    force_rmse_one_n,
    hit_rate_one,
    location_error_mm,
)
from ertskin.evaluation.outcome import Outcome, force_map_n
from ertskin.evaluation.predictions import as_builtins, evaluate_predictions, tuned_threshold_n
from ertskin.physics.sensor import taxel_grid_m

TAXEL_M = taxel_grid_m((0.12, 0.12), 6, 6)


def trials(contacts: int, frames: int = 200, seed: int = 0, noise_n: float = 0.4) -> Outcome:
    """Random presses with an estimate that is sometimes wrong in place and always a little in force."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((frames, 36))
    for frame in range(frames):
        truth[frame, rng.choice(36, contacts, replace=False)] = rng.uniform(0.5, 9.0, contacts)
    estimate = truth + noise_n * rng.standard_normal(truth.shape) * (rng.random(truth.shape) < 0.05)
    estimate += 0.2 * rng.standard_normal(truth.shape) * (truth > 0)
    estimate[rng.random(frames) < 0.1] = 0.0
    return Outcome(truth, estimate, estimate > 0.3, TAXEL_M)


def test_hit_rate_is_sklearn_subset_accuracy():
    outcome = trials(1)
    assert 0.1 < hit_rate_one(outcome).value < 0.95
    assert hit_rate_one(outcome).value == pytest.approx(accuracy_score(outcome.true_map_n > 0, outcome.present))


def test_hit_rate_per_taxel_by_hand():
    truth = np.zeros((4, 3))
    truth[[0, 1, 2, 3], [0, 0, 1, 1]] = 2.0
    estimate = truth.copy()
    estimate[1, 2] = 1.0  # a ghost
    score = hit_rate_one(Outcome(truth, estimate, estimate > 0.5, TAXEL_M[:3]))
    assert score.value == 0.75
    np.testing.assert_array_equal(score.per_taxel, [0.5, 1.0, np.nan])
    assert (score.taxel_mean, score.taxel_spread) == (0.75, 0.25)


def test_force_rmse_counts_a_miss_as_zero():
    outcome = trials(1)
    truth = outcome.true_map_n.max(axis=1)
    taxel = outcome.true_map_n.argmax(axis=1)
    estimate = [row[k] if seen[k] else 0.0 for row, seen, k in zip(outcome.map_n, outcome.present, taxel, strict=True)]
    assert force_rmse_one_n(outcome).value == pytest.approx(np.sqrt(mean_squared_error(truth, estimate)))
    assert force_correlation_one(outcome).value == pytest.approx(stats.pearsonr(truth, estimate).statistic)
    of_taxel = taxel == 7
    per_taxel = np.sqrt(mean_squared_error(truth[of_taxel], np.array(estimate)[of_taxel]))
    assert force_rmse_one_n(outcome).per_taxel[7] == pytest.approx(per_taxel)


def test_a_touch_at_the_wrong_place_errs_by_its_whole_force():
    truth, estimate = np.zeros((1, 36)), np.zeros((1, 36))
    truth[0, 3], estimate[0, 4] = 5.0, 5.0
    assert force_rmse_one_n(Outcome(truth, estimate, estimate > 0, TAXEL_M)).value == 5.0


def test_correlation_of_a_constant_is_not_a_number():
    truth = np.eye(36) * np.arange(1, 37)[:, None]
    assert np.isnan(force_correlation_one(Outcome(truth, np.ones((36, 36)), np.ones((36, 36), bool), TAXEL_M)).value)


def test_two_point_metrics_by_a_loop():
    outcome = trials(2, seed=1)
    exact, errors = [], []
    for truth, estimate, present in zip(outcome.true_map_n, outcome.map_n, outcome.present, strict=True):
        exact.append(set(np.flatnonzero(truth)) == set(np.flatnonzero(present)))
        errors += [abs((estimate[k] if present[k] else 0.0) - truth[k]) for k in np.flatnonzero(truth)]
    assert exact_rate_two(outcome).value == pytest.approx(np.mean(exact))
    assert force_error_two_n(outcome).value == pytest.approx(np.mean(errors))


def test_location_error_of_a_map_is_the_centroid_distance():
    truth, estimate = np.zeros((1, 36)), np.zeros((1, 36))
    truth[0, 0] = 4.0
    estimate[0, [0, 1]] = 3.0, 1.0  # a quarter of the force one pitch (20 mm) away
    assert location_error_mm(Outcome(truth, estimate, estimate > 0, TAXEL_M)).value == pytest.approx(5.0)


def test_location_error_assigns_and_blames_a_miss():
    truth = np.zeros((1, 36))
    truth[0, [0, 35]] = 4.0
    places = np.array([[[0.11, 0.11], [np.nan, np.nan]]])
    outcome = Outcome(truth, truth, truth > 0, TAXEL_M, located_m=places)
    from_centre_mm = 1e3 * np.linalg.norm(TAXEL_M[0] - 0.06)
    assert location_error_mm(outcome).value == pytest.approx(from_centre_mm / 2)
    swapped = Outcome(truth, truth, truth > 0, TAXEL_M, located_m=np.array([[[0.11, 0.11], [0.01, 0.01]]]))
    assert location_error_mm(swapped).value == pytest.approx(0.0, abs=1e-9)


def test_location_error_uses_the_true_places_between_taxels():
    contact_m = np.array([[[0.013, 0.014]]])
    truth = force_map_n(contact_m, np.array([[3.0]]), TAXEL_M)
    assert truth[0, 0] == 3.0
    outcome = Outcome(truth, truth, truth > 0, TAXEL_M, contact_m=contact_m)
    assert location_error_mm(outcome).value == pytest.approx(5.0)


def test_force_map_skips_absent_contacts():
    contact_m = np.array([[[0.01, 0.01], [np.nan, np.nan]], [[0.11, 0.11], [0.03, 0.01]]])
    maps = force_map_n(contact_m, np.array([[1.0, np.nan], [2.0, 3.0]]), TAXEL_M)
    assert maps.sum() == 6.0
    assert (maps[0, 0], maps[1, 35], maps[1, 1]) == (1.0, 2.0, 3.0)


def test_evaluate_predictions_reports_only_what_was_tested():
    one, two = trials(1), trials(2)
    assert set(evaluate_predictions(one.true_map_n, one.map_n, TAXEL_M)) == {
        "hit_rate_one",
        "force_rmse_one_n",
        "force_correlation_one",
        "location_error_mm",
    }
    assert "exact_rate_two" in evaluate_predictions(two.true_map_n, two.map_n, TAXEL_M)
    table = as_builtins(evaluate_predictions(one.true_map_n[:1], one.map_n[:1], TAXEL_M))
    assert table["hit_rate_one"]["per_taxel"].count(None) == 35


def test_tuned_threshold_finds_the_gap():
    rng = np.random.default_rng(0)
    truth = np.eye(36) * 5.0
    estimate = truth * 0.6 + rng.uniform(0.0, 1.2, truth.shape) * (truth == 0)
    assert 1.2 <= tuned_threshold_n(truth, estimate) <= 3.0


def test_shapes_and_values_that_do_not_fit_are_refused():
    good = np.zeros((2, 36))
    with pytest.raises(ValueError, match="map_n has shape"):
        Outcome(good, good[:, :5], good > 0, TAXEL_M)
    with pytest.raises(ValueError, match="not finite"):
        Outcome(good, good * np.nan, good > 0, TAXEL_M)
