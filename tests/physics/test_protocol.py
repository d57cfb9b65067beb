"""The 276 numbers: exact both ways, for the paper's pattern and for any other."""

import numpy as np
import pytest

from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances, transfer_matrix

ELECTRODES = 24


@pytest.fixture
def transfer():
    """A random passive reciprocal network: the pseudo-inverse of a weighted graph Laplacian."""
    rng = np.random.default_rng(0)
    conductance = np.triu(rng.random((ELECTRODES, ELECTRODES)), 1)
    conductance += conductance.T
    return np.linalg.pinv(np.diag(conductance.sum(axis=1)) - conductance)


def test_pair_resistances_hold_all_a_network_can_say(transfer):
    assert transfer_matrix(pair_resistances(transfer)) == pytest.approx(transfer, abs=1e-12)


def test_the_paper_has_6624_readings_against_the_sink(transfer):
    protocol = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-4)
    readings = protocol.readings(pair_resistances(transfer))
    assert readings.size == 6624
    for row, (source, sink) in enumerate(protocol.pairs[::37]):
        potential = 1e-4 * (transfer[:, source] - transfer[:, sink])
        assert readings[::37][row] == pytest.approx(potential - potential[sink], abs=1e-14)


def test_arbitrary_currents_and_differences(transfer):
    rng = np.random.default_rng(1)
    current = rng.standard_normal((40, ELECTRODES))
    current -= current.mean(axis=1, keepdims=True)
    measurement = np.stack([np.arange(23), np.arange(1, 24)], axis=1)
    protocol = Protocol.differences(current, measurement)
    potential = current @ transfer
    expected = potential[:, :-1] - potential[:, 1:]
    assert protocol.readings(pair_resistances(transfer)) == pytest.approx(expected, abs=1e-12)
    assert protocol.reciprocal(expected) == pytest.approx(pair_resistances(transfer), rel=1e-8)


def test_white_noise_stays_white_and_the_rest_is_what_no_network_gives(transfer):
    protocol = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-4)
    resistance = pair_resistances(transfer)
    clean = protocol.readings(resistance)
    reciprocal, rest = protocol.split(clean)
    assert np.abs(rest).max() < 1e-12
    assert reciprocal == pytest.approx(clean, abs=1e-12)
    assert protocol.whitened(resistance) == pytest.approx(clean.ravel() @ protocol.orthonormal, abs=1e-12)
    assert protocol.orthonormal.T @ protocol.orthonormal == pytest.approx(np.eye(276), abs=1e-10)
    assert protocol.unwhitened(protocol.whitened(resistance)) == pytest.approx(resistance, rel=1e-9)


def undriven(electrodes):
    """The adjacent scheme without the readings at driven electrodes."""
    number = np.arange(electrodes)
    reads = np.stack([number, (number + 1) % electrodes], axis=1)
    measured = ~(reads[None, :, :, None] == reads[:, None, None, :]).any(axis=(2, 3))
    current = 1e-3 * (np.eye(electrodes) - np.eye(electrodes)[reads[:, 1]])
    return Protocol.differences(current, reads, measured=measured)


def test_a_scan_without_its_driven_electrodes_tells_what_its_readings_tell():
    protocol = undriven(16)
    assert protocol.count == 208
    # Of 120 pair resistances 16 combinations are told by no reading: one an electrode, where its contact's share lies.
    assert protocol.factor.shape == (104, 120)
    rng = np.random.default_rng(2)
    pairs = 10 + rng.random(120)
    readings = protocol.readings(pairs)
    assert (readings[~protocol.taken] == 0).all()
    gapped = protocol.gapped(readings)
    assert np.isnan(gapped).sum() == 48
    found = protocol.reciprocal(gapped)
    assert protocol.readings(found) == pytest.approx(readings, abs=1e-12)
    assert np.linalg.norm(found) < np.linalg.norm(pairs)
    coordinates = protocol.whitened(pairs)
    assert protocol.whitened(protocol.unwhitened(coordinates)) == pytest.approx(coordinates, abs=1e-12)
    assert protocol.orthonormal.T @ protocol.orthonormal == pytest.approx(np.eye(104), abs=1e-10)
    assert not protocol.orthonormal[~protocol.taken.ravel()].any()


def test_a_contact_shows_in_no_reading_of_undriven_electrodes():
    """A resistor in series with an electrode: r_ij = z_i + z_j changes nothing that this scan reads."""
    i, j = np.triu_indices(16, 1)
    contact = np.random.default_rng(3).random(16)
    assert undriven(16).readings(contact[i] + contact[j]) == pytest.approx(0.0, abs=1e-15)
