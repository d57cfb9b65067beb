"""The paper's networks have the paper's layers (IV-A)."""

import numpy as np
import torch
from resistor_sheet import mixed, protocol, taxel_m
from torch import nn

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet, joined
from ertskin.models.batch_norm import BatchNorm
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.models.readings_layer import ReadingsLayer, distinct_rows
from ertskin.physics.noise import WhiteNoise

TAXELS = [[0.01 * k, 0.0] for k in range(36)]


def kinds(part: nn.Module) -> list[type]:
    return [type(layer) for layer in part]


def test_localization_and_force_have_two_hidden_layers_of_36_with_batch_norm():
    network = MaskedNetwork(6624, TAXELS)
    # The first layers of both parts lie side by side in one matrix.
    assert network.first[0].weight.shape == (6624, 72)
    assert kinds(network.first) == [ReadingsLayer, BatchNorm]
    assert kinds(network.location) == [nn.Sigmoid, nn.Linear, BatchNorm, nn.Sigmoid, nn.Linear]
    assert kinds(network.force) == [nn.ReLU, nn.Linear, BatchNorm, nn.ReLU, nn.Linear]
    for part in (network.location, network.force):
        assert part[1].weight.shape == (36, 36)
        assert part[4].weight.shape == (36, 36)


def test_batches_are_normalised_as_torch_does():
    torch.manual_seed(0)
    lean, usual = BatchNorm(5), nn.BatchNorm1d(5)
    for values in torch.randn(3, 8, 5):
        assert torch.equal(lean(values), usual(values))
    assert torch.equal(lean.eval()(values), usual.eval()(values))


def test_the_force_counts_only_where_the_mask_lets_it_through_and_is_never_negative():
    torch.manual_seed(0)
    network = MaskedNetwork(224, taxel_m().tolist()).eval()
    change_v = torch.randn(50, 224)
    logit, force = network.layers_out(network.scaled(change_v))
    estimate = network.estimate(change_v)
    assert (force >= 0).all()
    assert np.array_equal(estimate.present, (torch.sigmoid(logit) > 0.5).numpy())
    assert (estimate.force_map_n[~estimate.present] == 0).all()
    assert np.allclose(estimate.force_map_n[estimate.present], force.detach().numpy()[estimate.present])


def prepared() -> tuple[MaskedNetwork, TrialSet, TrialTensors]:
    torch.manual_seed(0)
    skin, trials = protocol(), mixed(300, seed=0)
    network = MaskedNetwork(224, taxel_m().tolist(), hidden=8)
    return network, trials, network.prepare(skin, trials, WhiteNoise(skin, 0.1), seed=0)


def test_the_parts_learn_as_if_they_were_trained_apart():
    network, _, tensors = prepared()
    losses = network.losses(tensors.inputs[:16], {name: value[:16] for name, value in tensors.targets.items()})
    (by_force,) = torch.autograd.grad(losses["force"], network.readings.weight, retain_graph=True)
    (by_location,) = torch.autograd.grad(losses["location"], network.readings.weight)
    assert torch.count_nonzero(by_force[:, :8]) == 0
    assert torch.count_nonzero(by_location[:, 8:]) == 0
    assert torch.count_nonzero(by_force) > 0


def test_readings_are_standardised_with_their_exact_moments():
    network, trials, _ = prepared()
    readings = trials.readings_v(protocol())
    scaled = network.scaled(torch.from_numpy(readings))
    varies = readings.std(axis=0) > 1e-9
    assert scaled.mean(dim=0).abs().max() < 1e-4
    assert torch.allclose(scaled.std(dim=0, correction=0)[varies], torch.ones(int(varies.sum())), atol=1e-4)


def test_learning_from_pair_resistances_is_learning_from_standardised_readings():
    network, trials, tensors = prepared()
    scaled = network.scaled(torch.from_numpy(trials.readings_v(protocol())))
    by_readings, by_pairs = network.layers_out(scaled), network.trials_out(tensors.inputs)
    for one, other in zip(by_readings, by_pairs, strict=True):
        assert torch.allclose(one, other, atol=1e-4)


def test_training_distinct_readings_takes_the_steps_of_training_all_of_them():
    network, trials, tensors = prepared()
    layer = network.readings
    scaled = network.scaled(torch.from_numpy(trials.readings_v(protocol())))
    every = nn.Parameter(layer.readings_weight().detach().clone())
    bias = nn.Parameter(layer.bias.detach().clone())
    assert len(layer.weight) < len(every)
    few_adam, all_adam = (torch.optim.Adam(p, lr=1e-2) for p in (layer.parameters(), [every, bias]))
    for _ in range(5):
        for adam, out in ((few_adam, layer.of_pairs(tensors.inputs)), (all_adam, torch.addmm(bias, scaled, every))):
            adam.zero_grad()
            (out - 1).square().mean().backward()
            adam.step()
    assert (every - layer.readings_weight()).abs().max() < 2e-4
    assert torch.allclose(layer(scaled), torch.addmm(bias, scaled, every), atol=2e-3)


def test_rows_that_differ_in_sign_alone_are_one():
    rows = np.array([[0.0, 2.0], [0.0, 0.0], [1.0, -3.0], [0.0, -2.0], [-1.0, 3.0], [1.0, 3.0]])
    first, copied, sign = distinct_rows(rows)
    assert len(first) == 3
    assert np.array_equal(sign[:, None] * rows[first][copied], rows)


def test_a_trained_layer_is_read_from_its_weights():
    network, trials, _ = prepared()
    fresh = MaskedNetwork(**network.arguments)
    fresh.load_state_dict(network.state_dict())
    scaled = network.scaled(torch.from_numpy(trials.readings_v(protocol())))
    assert torch.equal(fresh.readings(scaled), network.readings(scaled))


def test_the_denoiser_is_given_real_readings_where_there_are_any_and_noise_elsewhere():
    skin, simulated = protocol(), mixed(60, seed=0)
    clean = simulated.readings_v(skin)
    real = TrialSet(
        simulated.change_ohm, simulated.force_map_n, simulated.contact_m, simulated.force_n, clean + np.float32(0.5)
    )
    denoiser = Denoiser(224, hidden=4)
    noise = WhiteNoise(skin, 1e-3)
    tensors = denoiser.prepare(skin, joined([real, simulated]), noise, seed=0)
    added = (tensors.inputs - tensors.targets["clean"]) * denoiser.scale.std
    assert torch.allclose(added[:60], torch.tensor(0.5), atol=1e-3)
    assert 0.8e-3 < float(added[60:].std()) < 1.2e-3
    again = denoiser.prepare(skin, joined([real, simulated]), noise, seed=0)
    assert torch.equal(tensors.inputs, again.inputs)
