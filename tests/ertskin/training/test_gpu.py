"""Networks trained on a GPU say what those trained on the processor say; skipped where torch finds none."""

from pathlib import Path

import numpy as np
import pytest
import torch
from lightning.fabric.accelerators.mps import MPSAccelerator
from resistor_sheet import SIZE_M, mixed, protocol, taxel_m

from ertskin.errors import UserError
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.models.network import Network
from ertskin.models.places import PlacesNetwork
from ertskin.models.reciprocal import ReciprocalNetwork
from ertskin.physics.noise import WhiteNoise
from ertskin.training import accelerator
from ertskin.training.fit import fit
from ertskin.training.settings import TrainerSettings, trainer_settings

READINGS, PAIRS = 224, 28
NETWORKS = {
    "paper": lambda: MaskedNetwork(READINGS, taxel_m().tolist(), hidden=8),
    "denoiser": lambda: Denoiser(READINGS, hidden=8),
    # Dropout draws on the device itself, where its generator is another one.
    "reciprocal": lambda: ReciprocalNetwork(PAIRS, taxel_m().tolist(), width=16, blocks=1, dropout=0.0),
    "places": lambda: PlacesNetwork(PAIRS, taxel_m().tolist(), width=16),
}
ROUNDING = 1e-3
"""Share of a loss by which sums in another order may part two trainings of three epochs: Adam divides small gradients
by their own size, so weights may part by more (the compiled gradient parts losses by 1e-4, single weights by 8e-2)."""


def trained(name: str, accelerator: str, folder: Path) -> tuple[Network, dict[str, float]]:
    """The network after a short training, its best validation loss and the terms of its loss over all trials."""
    torch.manual_seed(0)
    network, skin = NETWORKS[name](), protocol()
    trials = network.prepare(skin, mixed(240, seed=0, jitter_m=0.1 * SIZE_M / 3), WhiteNoise(skin, 1e-4), seed=0)
    settings = TrainerSettings(batch=16, max_epochs=3, accelerator=accelerator, seed=3)
    best = fit(network, trials, settings, folder).loss
    with torch.no_grad():
        terms = network.losses(trials.inputs, trials.targets)
    return network, {"best": best, **{term: float(value) for term, value in terms.items()}}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no GPU here")
@pytest.mark.parametrize("name", NETWORKS)
def test_a_gpu_trains_what_the_processor_trains(name: str, tmp_path: Path) -> None:
    _, losses = trained(name, "cpu", tmp_path / "cpu")
    _, losses_gpu = trained(name, "gpu", tmp_path / "gpu")
    assert losses_gpu == pytest.approx(losses, rel=ROUNDING)


def test_a_mac_trains_on_its_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Apple's GPUs have no double precision, in which tables and grids are kept."""
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    network, losses = trained("reciprocal", "cpu", tmp_path / "cpu")
    monkeypatch.setattr(MPSAccelerator, "is_available", staticmethod(lambda: True))
    network_auto, losses_auto = trained("reciprocal", "auto", tmp_path / "auto")
    assert losses_auto == losses
    weights = network_auto.state_dict()
    assert all(np.array_equal(weights[key], value) for key, value in network.state_dict().items())
    monkeypatch.setattr(accelerator.platform, "system", lambda: "Darwin")
    with pytest.raises(UserError, match="no double precision"):
        trainer_settings({"accelerator": "gpu"}, 0)
