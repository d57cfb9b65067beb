"""The compiled gradient of the masked network is autograd's."""

import numpy as np
import pytest
import torch

from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.masked import MaskedNetwork
from ertskin.models.network import Network
from ertskin.physics.noise.white import WhiteNoise
from ertskin.physics.protocol import Protocol, electrode_pairs

PROTOCOL = Protocol.against_sink(electrode_pairs(5), 5, 1e-4)
TAXELS = 7


def trained_a_little(seed: int) -> tuple[MaskedNetwork, TrialTensors]:
    """A network whose weights and normalisation are no longer the first ones, and its trials."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    readings, pairs = PROTOCOL.design.shape
    force = (rng.random((64, TAXELS)) < 0.3) * rng.uniform(0.1, 10.0, (64, TAXELS))
    trials = TrialSet(rng.normal(size=(64, pairs)), force, np.zeros((64, 2, 2)), np.ones((64, 2)))
    network = MaskedNetwork(readings, [[0.0, 0.01 * k] for k in range(TAXELS)], hidden=9)
    tensors = network.prepare(PROTOCOL, trials, WhiteNoise(PROTOCOL, 1e-3), seed)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 0.1 * torch.randn_like(parameter)
    return network.train(), tensors


@pytest.mark.parametrize("rows", [32, 2])
def test_loss_gradient_and_running_statistics_are_those_of_the_modules(rows):
    (ours, trials), (theirs, _) = trained_a_little(3), trained_a_little(3)
    inputs, targets = trials.inputs[:rows], {name: value[:rows] for name, value in trials.targets.items()}
    for _ in range(2):
        mine, others = ours.gradient()(inputs, targets), Network.gradient(theirs)(inputs, targets)
        assert torch.isclose(mine, others, rtol=1e-5)
    largest = max(float(p.grad.abs().max()) for p in theirs.parameters())
    for (name, one), other in zip(ours.named_parameters(), theirs.parameters(), strict=True):
        assert torch.allclose(one.grad, other.grad, rtol=1e-3, atol=1e-5 * largest), name
    for (name, one), other in zip(ours.named_buffers(), theirs.buffers(), strict=True):
        assert torch.allclose(one, other, rtol=1e-5, atol=1e-7), name


@pytest.fixture(params=[1, 2])
def threads(request):
    """The products' bits are those of a number of threads: it is the same throughout a training."""
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield request.param
    torch.set_num_threads(before)


@pytest.mark.usefixtures("threads")
def test_the_gradient_of_one_batch_leaves_nothing_in_the_next():
    network, trials = trained_a_little(5)
    batches = [(trials.inputs[k::2], {name: value[k::2] for name, value in trials.targets.items()}) for k in range(2)]
    gradient = network.gradient()
    gradient(*batches[0])
    gradient(*batches[1])
    after = [parameter.grad.clone() for parameter in network.parameters()]
    for parameter in network.parameters():
        parameter.grad = None
    network.gradient()(*batches[1])
    for parameter, kept in zip(network.parameters(), after, strict=True):
        assert torch.equal(parameter.grad, kept)
