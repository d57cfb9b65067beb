"""Modulus of a coupon, made and measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ertskin.physics.calibration.coupon import CouponModulus, coupon_modulus

HEIGHT, AREA = 0.01, 4e-5


def squeeze(modulus_pa: float, lateral: str, softened: float = 1.0) -> CouponModulus:
    time = np.linspace(0, 30, 6001)
    strain = 0.15 * (1 - np.cos(2 * np.pi * time / 10))
    stiffness = np.where(time < 5, modulus_pa, softened * modulus_pa)
    stress = stiffness * np.maximum(strain - 0.01, 0)
    noise = 0.01 * np.random.default_rng(0).standard_normal(time.size)
    return coupon_modulus(time, HEIGHT * (1 - strain), stress * AREA + noise, HEIGHT, AREA, lateral)


def test_free_sides_give_youngs_modulus():
    result = squeeze(4e5, "free")
    assert result.first_pa == pytest.approx(4e5, rel=0.01)
    assert result.cycled_pa == pytest.approx(4e5, rel=0.01)
    assert result.settling_strain == pytest.approx(0.01, abs=1e-3)
    assert result.loadings == 3


def test_confined_sides_stiffen_by_poissons_ratio():
    oedometric = 4e5 * 0.7 / (1.3 * 0.4)
    assert squeeze(oedometric, "confined").first_pa == pytest.approx(4e5, rel=0.01)


def test_softening_after_the_first_loading_shows():
    result = squeeze(4e5, "free", softened=0.6)
    assert result.cycled_pa / result.first_pa == pytest.approx(0.6, rel=0.02)


def test_no_loading_and_unknown_sides_are_refused():
    flat = np.full(100, HEIGHT)
    with pytest.raises(ValueError, match="no loading"):
        coupon_modulus(np.arange(100.0), flat, np.zeros(100), HEIGHT, AREA, "free")
    with pytest.raises(ValueError, match="lateral"):
        coupon_modulus(np.arange(100.0), flat, np.zeros(100), HEIGHT, AREA, "loose")


def test_real_coupons_soften_and_agree_with_one_another(shared_data: Path):
    from ertskin.hardware.recording import read_recording

    moduli = []
    for number in range(1, 6):
        c = read_recording(shared_data / "real" / f"foam_turbo_free_{number}.h5").coupon
        assert c is not None
        moduli.append(coupon_modulus(c.time_s, c.gap_m, c.force_n, c.height_m, c.area_m2, c.lateral))
    first, cycled = np.array([m.first_pa for m in moduli]), np.array([m.cycled_pa for m in moduli])
    assert np.all(cycled < 0.8 * first)
    assert np.mean(first) == pytest.approx(0.83e6, rel=0.1)
    assert np.std(cycled) / np.mean(cycled) < 0.1
