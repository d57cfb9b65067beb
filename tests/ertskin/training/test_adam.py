"""The lean Adam is PyTorch's."""

import torch
from torch import nn

from ertskin.training.adam import LeanAdam


def network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(5, 7), nn.Tanh(), nn.Linear(7, 3))


def test_it_takes_the_same_steps_bit_for_bit_also_after_its_state_was_stored():
    lean, usual = network(), network()
    ours, theirs = LeanAdam(lean.parameters(), 1e-2), torch.optim.Adam(usual.parameters(), lr=1e-2, fused=True)
    inputs = torch.randn(4, 5)
    for step in range(12):
        if step == 6:
            stored = ours.state_dict()
            ours = LeanAdam(lean.parameters(), 1e-2)
            ours.load_state_dict(stored)
        if step == 9:
            for optimizer in (ours, theirs):
                optimizer.param_groups[0]["lr"] = 1e-3
        ours.zero_grad()
        lean(inputs).square().sum().backward()
        ours.update()
        theirs.zero_grad()
        usual(inputs).square().sum().backward()
        theirs.step()
    for one, other in zip(lean.parameters(), usual.parameters(), strict=True):
        assert torch.equal(one, other)
