"""The yardsticks against independent references: scikit-learn, normal equations, brute force, a closed form."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import least_squares
from sklearn.isotonic import IsotonicRegression
from sklearn.kernel_ridge import KernelRidge as SklearnKernelRidge
from sklearn.linear_model import Ridge as SklearnRidge

from ertskin.evaluation.yardsticks import GaussNewtonImaging, KernelRidge, MaximumLikelihood, Mean, Ridge
from ertskin.evaluation.yardsticks.cramer_rao import force_bound_n
from ertskin.evaluation.yardsticks.forward import Response
from ertskin.evaluation.yardsticks.gauss_newton_imaging import Curve
from ertskin.evaluation.yardsticks.held_out_regime import force_bands
from ertskin.evaluation.yardsticks.peaks import highest_near
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import taxel_grid_m

TAXEL_M = taxel_grid_m((0.06, 0.06), 3, 3)
PROTOCOL = Protocol.against_sink(electrode_pairs(8), 8, 1e-3)


class SaturatingSkin:
    """A toy skin: every contact lowers the pair resistances by a saturating law, and contacts shade each other."""

    def __init__(self, gain_ohm: float = 30.0):
        self.pattern_ohm = gain_ohm * np.random.default_rng(5).uniform(0.2, 1.0, (9, 28)) ** 2

    def change_ohm(self, contact_m: np.ndarray, force_n: np.ndarray) -> np.ndarray:
        taxel = np.linalg.norm(contact_m[:, :, None] - TAXEL_M, axis=-1).argmin(axis=-1)
        strength = 1.0 - np.exp(-force_n / 4.0)
        shade = 1.0 - 0.1 * np.prod(strength, axis=1) * (force_n.shape[1] > 1)
        return -np.einsum("nc,ncp->np", strength, self.pattern_ohm[taxel]) * shade[:, None]


@pytest.fixture(scope="module")
def response() -> Response:
    return Response(SaturatingSkin(), PROTOCOL, TAXEL_M)


def presses(response: Response, contacts: int, frames: int, seed: int, noise_v: float = 1e-4):
    """(N,P) noisy changes, (N,9) force maps, and the taxels and forces behind them."""
    rng = np.random.default_rng(seed)
    taxel = np.stack([rng.choice(9, contacts, replace=False) for _ in range(frames)])
    force_n = rng.uniform(0.5, 8.0, (frames, contacts))
    maps = np.zeros((frames, 9))
    np.put_along_axis(maps, taxel, force_n, axis=1)
    clean_v = response.change_v(taxel, force_n)
    return clean_v + noise_v * rng.standard_normal(clean_v.shape), maps, taxel, force_n


def rmse(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


def test_bands_hold_out_forces_never_trained_on():
    maps = np.random.default_rng(0).uniform(0.0, 9.0, (50, 1))
    for train, test in force_bands(maps):
        inside = (maps[train] > maps[test].min()) & (maps[train] < maps[test].max())
        assert not inside.any()
        assert len(train) + len(test) == 50


def test_mean_is_the_mean():
    maps = np.random.default_rng(0).random((10, 9))
    np.testing.assert_allclose(Mean().fit(maps, maps).predict(maps[:3]), np.tile(maps.mean(axis=0), (3, 1)))


def test_ridge_is_sklearns_at_the_penalty_it_chose(response):
    change_v, maps, *_ = presses(response, 1, 300, seed=1)
    ours = Ridge().fit(change_v, maps)
    largest = np.linalg.eigvalsh((change_v - change_v.mean(0)).T @ (change_v - change_v.mean(0)))[-1]
    theirs = SklearnRidge(alpha=ours.penalty_ * largest).fit(change_v, maps)
    np.testing.assert_allclose(ours.predict(change_v[:20]), theirs.predict(change_v[:20]), rtol=1e-6, atol=1e-6)


def test_kernel_ridge_is_sklearns_at_what_it_chose(response):
    change_v, maps, *_ = presses(response, 1, 200, seed=2)
    ours = KernelRidge(penalties=(1e-6, 1e-4)).fit(change_v, maps)
    order = np.random.default_rng(0).permutation(200)
    features = np.sign(change_v) * np.abs(change_v) ** ours.power_ / ours.scale_
    gamma = 0.5 / ours.width_**2
    kernel = np.exp(-gamma * ((features[:, None] - features) ** 2).sum(-1))
    theirs = SklearnKernelRidge(alpha=ours.penalty_ * np.linalg.eigvalsh(kernel)[-1], kernel="rbf", gamma=gamma)
    theirs.fit(features[order], maps[order] - maps.mean(0))
    np.testing.assert_allclose(
        ours.predict(change_v[:20]), theirs.predict(features[:20]) + maps.mean(0), rtol=1e-5, atol=1e-5
    )


def test_kernel_ridge_beats_ridge_beats_the_mean_on_a_saturating_skin(response):
    train_v, train_n, *_ = presses(response, 1, 600, seed=3)
    test_v, test_n, *_ = presses(response, 1, 200, seed=4)
    error = {y.name: rmse(y.fit(train_v, train_n).predict(test_v), test_n) for y in (Mean(), Ridge(), KernelRidge())}
    assert error["kernel ridge"] < 0.7 * error["ridge"] < 0.7 * error["mean"]


@pytest.mark.parametrize("contacts", [1, 2])
def test_oracle_finds_what_brute_force_finds(response, contacts):
    noise_v = 3e-4
    change_v, maps, *_ = presses(response, contacts, 6, seed=6, noise_v=noise_v)
    oracle = MaximumLikelihood(response, noise_v**2, np.linspace(0.25, 9.0, 36))
    said_n = oracle.predict(change_v)
    np.testing.assert_array_equal(said_n > 0, maps > 0)
    for row, change in zip(said_n, change_v, strict=True):
        best = min(
            (
                least_squares(
                    lambda f, k=taxels, y=change: (response.change_v(np.array([k]), f[None])[0] - y) / noise_v,
                    np.full(contacts, 3.0),
                    bounds=(0.0, 9.0),
                )
                for taxels in combinations(range(9), contacts)
            ),
            key=lambda fit: fit.cost,
        )
        np.testing.assert_allclose(np.sort(row[row > 0]), np.sort(best.x), atol=5e-3)


def test_oracle_says_nothing_of_noise(response):
    noise_v = 1e-4 * np.random.default_rng(0).standard_normal((20, 28))
    oracle = MaximumLikelihood(response, 1e-8, np.linspace(0.25, 9.0, 36))
    assert (oracle.predict(noise_v).sum(axis=1) == 0).mean() >= 0.9


def test_cramer_rao_bound_is_the_closed_form_for_one_contact(response):
    taxel, force_n, noise_v = np.array([[4]]), np.array([[3.0]]), 2e-3
    skin = SaturatingSkin()
    slope_ohm = -skin.pattern_ohm[4] * np.exp(-3.0 / 4.0) / 4.0
    expected_n = noise_v / np.linalg.norm(PROTOCOL.readings(slope_ohm))
    bound_n = force_bound_n(response, taxel, force_n, noise_v**2)
    assert bound_n[0, 0] == pytest.approx(expected_n, rel=1e-4)


def test_oracle_reaches_the_cramer_rao_bound(response):
    rng, noise_v = np.random.default_rng(9), 1e-3
    taxel, force_n = np.tile([[2, 7]], (200, 1)), np.tile([[3.0, 5.0]], (200, 1))
    clean_v = response.change_v(taxel, force_n)
    oracle = MaximumLikelihood(response, noise_v**2, np.linspace(0.25, 9.0, 36), candidates=1)
    said_n = oracle.predict(clean_v + noise_v * rng.standard_normal(clean_v.shape))[:, [2, 7]]
    bound_n = force_bound_n(response, taxel[:1], force_n[:1], noise_v**2)[0]
    np.testing.assert_allclose(said_n.std(axis=0), bound_n, rtol=0.2)


def imaging_problem():
    """A blurred linear sheet of 12x12 pixels read through 40 random projections."""
    rng = np.random.default_rng(11)
    pixel_m = taxel_grid_m((0.06, 0.06), 12, 12)
    jacobian_v = rng.standard_normal((40, 144))
    taxel = np.tile(np.arange(9), 20)
    force_n = rng.uniform(0.5, 8.0, len(taxel))
    spot = np.exp(-((np.linalg.norm(TAXEL_M[:, None] - pixel_m, axis=-1) / 0.006) ** 2))
    image = spot[taxel] * np.sqrt(force_n)[:, None]
    maps = np.zeros((len(taxel), 9))
    maps[np.arange(len(taxel)), taxel] = force_n
    return jacobian_v, pixel_m, image @ jacobian_v.T + 0.01 * rng.standard_normal((len(taxel), 40)), maps


def test_imaging_solves_the_normal_equations():
    jacobian_v, pixel_m, change_v, maps = imaging_problem()
    imaging = GaussNewtonImaging(jacobian_v, pixel_m, TAXEL_M).fit(change_v, maps)
    gram = jacobian_v.T @ jacobian_v
    scaled = jacobian_v / np.sqrt(np.diag(gram))
    weight = imaging.penalty_ * np.linalg.norm(scaled, 2) ** 2
    expected = np.linalg.solve(gram + weight * np.diag(np.diag(gram)), jacobian_v.T @ change_v[0])
    np.testing.assert_allclose(imaging.image(change_v[:1])[0], expected, rtol=1e-6, atol=1e-9)


def test_imaging_finds_single_presses():
    jacobian_v, pixel_m, change_v, maps = imaging_problem()
    said_n = GaussNewtonImaging(jacobian_v, pixel_m, TAXEL_M).fit(change_v[::2], maps[::2]).predict(change_v[1::2])
    assert (said_n.argmax(axis=1) == maps[1::2].argmax(axis=1)).mean() > 0.95
    touched = maps[1::2] > 0
    assert rmse(said_n[touched], maps[1::2][touched]) < 0.8


def test_imaging_refuses_pixels_too_coarse_for_its_footprint():
    with pytest.raises(ValueError, match="no pixel within the footprint"):
        GaussNewtonImaging(np.ones((4, 4)), taxel_grid_m((0.06, 0.06), 2, 2), TAXEL_M, footprint_m=0.001)


@pytest.mark.parametrize("repeated", [False, True])
def test_an_imaging_curve_is_scikit_learns(repeated: bool):
    rng = np.random.default_rng(4)
    image = rng.uniform(-0.2, 1.0, 60).round(1 if repeated else 12)
    force_n = np.maximum(5.0 * image, 0.0) + rng.uniform(0.0, 2.0, 60)
    curve = Curve(image, force_n)
    fit = IsotonicRegression(out_of_bounds="clip").fit(np.append(image, 0.0), np.append(force_n, 0.0))
    np.testing.assert_allclose(curve(curve.level[1:]), fit.predict(curve.level[1:]), rtol=1e-12)


def test_the_highest_near_a_point_is_that_of_its_own_and_its_neighbours():
    rng = np.random.default_rng(6)
    values, near = rng.standard_normal((20, 9)), rng.random((9, 9)) < 0.4
    near[2] = False
    dense = np.where(near | np.eye(9, dtype=bool), values[:, None, :], -np.inf).max(axis=2)
    np.testing.assert_array_equal(highest_near(values, near), dense)
