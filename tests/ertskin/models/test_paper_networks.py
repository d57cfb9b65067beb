"""The paper's networks have the paper's layers (IV-A)."""

import numpy as np
import torch
from resistor_sheet import mixed, protocol, taxel_m
from torch import nn

from ertskin.data.trials import TrialSet, joined
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from physics.noise import WhiteNoise

TAXELS = [[0.01 * k, 0.0] for k in range(36)]


def kinds(part: nn.Module) -> list[type]:
    return [type(layer) for layer in part]


def test_localization_and_force_have_two_hidden_layers_of_36_with_batch_norm():
    network = MaskedNetwork(6624, TAXELS)
    # The first layers of both parts lie side by side in one matrix.
    assert network.first[0].weight.shape == (72, 6624)
    assert kinds(network.first) == [nn.Linear, nn.BatchNorm1d]
    assert kinds(network.location) == [nn.Sigmoid, nn.Linear, nn.BatchNorm1d, nn.Sigmoid, nn.Linear]
    assert kinds(network.force) == [nn.ReLU, nn.Linear, nn.BatchNorm1d, nn.ReLU, nn.Linear]
    for part in (network.location, network.force):
        assert part[1].weight.shape == (36, 36)
        assert part[4].weight.shape == (36, 36)


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


def test_the_parts_learn_as_if_they_were_trained_apart():
    torch.manual_seed(0)
    network = MaskedNetwork(40, TAXELS[:9], hidden=8)
    inputs, touched = torch.randn(16, 40), (torch.rand(16, 9) < 0.3).float()
    losses = network.losses(inputs, {"touched": touched, "force_n": 5 * touched})
    (by_force,) = torch.autograd.grad(losses["force"], network.first[0].weight, retain_graph=True)
    (by_location,) = torch.autograd.grad(losses["location"], network.first[0].weight)
    assert torch.count_nonzero(by_force[:8]) == 0
    assert torch.count_nonzero(by_location[8:]) == 0


def test_inputs_are_standardised_with_the_exact_moments_of_the_readings():
    skin, trials = protocol(), mixed(300, seed=0)
    network = MaskedNetwork(224, taxel_m().tolist())
    inputs = network.prepare(skin, trials, WhiteNoise(skin, 0.1), seed=0).inputs
    varies = trials.readings_v(skin).std(axis=0) > 1e-9
    assert inputs.mean(dim=0).abs().max() < 1e-4
    assert torch.allclose(inputs.std(dim=0, correction=0)[varies], torch.ones(int(varies.sum())), atol=1e-4)


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
