"""Denoiser and network trained at once, in two processes, are those trained one after the other."""

import os
import signal
from dataclasses import replace
from functools import partial

import pytest
import torch
from resistor_sheet import mixed, protocol, taxel_m

from ertskin.data.material import Material
from ertskin.errors import JobFailed
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.physics.noise import WhiteNoise
from ertskin.training.reconstruct import train_reconstruction
from ertskin.training.settings import TrainerSettings

SETTINGS = TrainerSettings(batch=16, max_epochs=3, accelerator="cpu", seed=3)


class DiesOnce(Denoiser):
    """Takes its process with it in the second epoch, the first time it gets there."""

    def __init__(self, inputs, marker):
        super().__init__(inputs)
        self.marker = marker

    def on_train_epoch_start(self):
        super().on_train_epoch_start()
        if self.current_epoch == 1 and not self.marker.exists():
            self.marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)


class Fails(Denoiser):
    """Can't be trained."""

    def on_train_epoch_start(self):
        raise JobFailed("no such luck")


def trained(folder, threads, build_denoiser=Denoiser):
    skin, logged = protocol(), []
    noise = WhiteNoise(skin, 1e-4)
    material = Material(skin, taxel_m(), mixed(240, seed=0), noise, "sum", mixed(120, seed=1))
    reconstruction, fitted = train_reconstruction(
        material,
        partial(MaskedNetwork, hidden=8),
        partial(build_denoiser),
        replace(SETTINGS, threads=threads),
        folder,
        lambda stage, losses, epoch: logged.append((stage, epoch, losses["validation_loss"])),
    )
    weights = {**reconstruction.network.state_dict(), **reconstruction.denoiser.layers.state_dict()}
    return weights, {name: (one.loss, one.epoch) for name, one in fitted.items()}, sorted(logged)


@pytest.fixture(scope="module")
def one_after_the_other(tmp_path_factory):
    return trained(tmp_path_factory.mktemp("sequence"), threads=1)


def assert_same(one, other):
    assert one[1:] == other[1:]
    assert all(torch.equal(one[0][name], other[0][name]) for name in other[0])


def test_side_by_side_gives_the_same_weights_and_tells_every_epoch_of_both(tmp_path, one_after_the_other):
    assert_same(trained(tmp_path, threads=2), one_after_the_other)


def test_a_child_that_dies_is_gone_on_with(tmp_path, one_after_the_other):
    died = tmp_path / "died"
    assert_same(trained(tmp_path, 2, partial(DiesOnce, marker=died)), one_after_the_other)
    assert died.exists()


def test_a_childs_failure_is_met_here(tmp_path):
    with pytest.raises(JobFailed, match="no such luck"):
        trained(tmp_path, 2, Fails)
