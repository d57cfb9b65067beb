"""Spikes are told by the redundancy of a scan, even where a number has two readings behind it and no more."""

import numpy as np
import pytest
from test_protocol import undriven

from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.scan_reduction import ScanReduction
from ertskin.physics.spikes import completed, despiked


@pytest.fixture
def frames():
    """Twelve frames of one network, its readings with a millivolt of noise."""
    rng = np.random.default_rng(4)
    protocol = undriven(16)
    clean = protocol.readings(1e3 * (1 + 0.1 * rng.random(120)))
    return protocol, clean, protocol.gapped(clean + 1e-3 * rng.standard_normal((12, *protocol.shape)))


def test_of_two_reciprocal_readings_the_odd_one_is_left_out(frames):
    protocol, clean, voltage = frames
    voltage[3, 2, 9] += 0.5
    voltage[7, 9, 2] -= 0.5
    scan, left_out = despiked(protocol, voltage)
    assert left_out[3, 2, 9]
    assert not left_out[3, 9, 2]
    assert left_out[7, 9, 2]
    assert not left_out[7, 2, 9]
    assert left_out[:, ~protocol.taken].all()
    assert (left_out & protocol.taken).sum() < 8
    error = scan @ protocol.orthonormal.T - clean.ravel()
    assert np.abs(error).max() < 5e-3


def test_lost_readings_come_from_their_twins(frames):
    protocol, _, voltage = frames
    voltage[2, 4, 11] = np.nan
    voltage[5, 4, 11] = voltage[5, 11, 4] = np.nan
    whole = completed(protocol, voltage)
    assert whole[2, 4, 11] == pytest.approx(voltage[2, 11, 4], abs=1e-12)
    assert np.isnan(whole[5]).sum() == 2
    assert np.isfinite(np.delete(whole, 5, axis=0)).all()
    assert (whole[:, ~protocol.taken] == 0).all()


def test_one_scan_at_a_time_loses_the_same_readings():
    rng = np.random.default_rng(6)
    protocol = Protocol.against_sink(electrode_pairs(10), 10, 1e-3)
    voltage = protocol.readings(1e3 * (1 + 0.1 * rng.random(45)))[None]
    voltage += 1e-3 * rng.standard_normal(voltage.shape)
    voltage[0, 3, 4] += 0.2
    voltage[0, 3, 5] -= 0.06
    scan, left_out = despiked(protocol, voltage)
    assert left_out.sum() == 2
    reduction = ScanReduction(protocol, 1e-3)
    coordinates, clean, unexplained = reduction.despiked(voltage[0].ravel())
    np.testing.assert_allclose(coordinates, scan[0], atol=1e-9)
    np.testing.assert_allclose(clean - unexplained, protocol.orthonormal @ scan[0], atol=1e-9)
    assert (clean != voltage[0].ravel()).sum() == 2


def test_the_papers_scan_makes_up_for_a_whole_channel():
    rng = np.random.default_rng(5)
    protocol = Protocol.against_sink(electrode_pairs(8), 8, 1e-3)
    clean = protocol.readings(1e3 * (1 + 0.1 * rng.random(28)))[None]
    voltage = clean.copy()
    voltage[0, :, 3] = np.nan
    assert completed(protocol, voltage) == pytest.approx(clean, abs=1e-9)


@pytest.mark.parametrize("protocol", [Protocol.against_sink(electrode_pairs(10), 10, 1e-3), undriven(16)])
def test_a_scan_is_reduced_as_by_its_whole_matrix(protocol):
    rng = np.random.default_rng(8)
    readings, reduction = rng.standard_normal(len(protocol.orthonormal)), ScanReduction(protocol, 1e-3)
    readings[~protocol.taken.ravel()] = 0.0
    coordinates = reduction.coordinates(readings)
    np.testing.assert_allclose(coordinates, readings @ protocol.orthonormal, atol=1e-9)
    np.testing.assert_allclose(reduction.readings(coordinates), protocol.orthonormal @ coordinates, atol=1e-9)
