"""Coordinates of a scan, whole and deficient."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.physics.calibration.scan_space import ScanSpace
from ertskin.physics.protocol import Protocol


def test_whole_scan_has_the_protocols_own_coordinates(protocol: Protocol):
    space = ScanSpace.of(protocol)
    pairs = np.random.default_rng(0).uniform(1e4, 2e4, 28)
    voltage = protocol.readings(pairs)
    assert space.coordinates(voltage) == pytest.approx(protocol.whitened(pairs))
    assert space.design @ pairs == pytest.approx(protocol.whitened(pairs))


def test_deficient_scan_keeps_what_it_sees():
    current = np.zeros((3, 6))
    current[[0, 1, 2], [0, 2, 4]], current[[0, 1, 2], [1, 3, 5]] = 1e-3, -1e-3
    scan = Protocol.differences(current, np.array([[k, k + 1] for k in range(5)]))
    space = ScanSpace.of(scan)
    assert space.basis.shape[1] < 15
    assert space.basis.T @ space.basis == pytest.approx(np.eye(space.basis.shape[1]), abs=1e-9)
    pairs = np.random.default_rng(1).uniform(1e4, 2e4, 15)
    voltage = scan.readings(pairs)
    assert space.basis @ space.coordinates(voltage) == pytest.approx(voltage.ravel())
    assert space.design @ pairs == pytest.approx(space.coordinates(voltage))


def test_weights_scale_the_misfit(protocol: Protocol):
    weight = np.random.default_rng(2).uniform(0.1, 1.0, protocol.shape)
    space = ScanSpace.of(protocol, weight)
    pairs = np.random.default_rng(3).uniform(1e4, 2e4, 28)
    misfit = ((space.design @ pairs) ** 2).sum()
    assert misfit == pytest.approx((weight * protocol.readings(pairs) ** 2).sum())
