"""Training cut off anywhere and started again ends with the very same weights."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from resistor_sheet import mixed, protocol, taxel_m

from ertskin.data.tensors import TrialTensors
from ertskin.errors import JobFailed
from ertskin.models.masked import MaskedNetwork
from ertskin.models.reciprocal import ReciprocalNetwork
from ertskin.physics.noise import WhiteNoise
from ertskin.training import fit as fitting
from ertskin.training.settings import TrainerSettings

SETTINGS = TrainerSettings(batch=16, max_epochs=4, batches_per_chunk=2, checkpoint_s=0.0, accelerator="cpu", seed=3)


class Cut(Exception):
    """Stands for the end of the process."""


def network_and_trials() -> tuple[ReciprocalNetwork, TrialTensors]:
    torch.manual_seed(0)
    skin, trials = protocol(), mixed(240, seed=0)
    network = ReciprocalNetwork(28, taxel_m().tolist(), width=16, blocks=1, dropout=0.2)
    return network, network.prepare(skin, trials, WhiteNoise(skin, 1e-4), seed=0)


def trained(folder, cut_at: int | None = None, attempt: int = 0, log=None, **changed) -> dict[str, torch.Tensor]:
    """Weights after training on ``folder``; with ``cut_at`` the process "dies" in that training step.

    Every attempt but the first starts from another state of the random generator, as a new process would.
    """
    network, trials = network_and_trials()
    torch.manual_seed(99 + attempt)
    whole_step, steps = network.training_step, iter(range(1000))

    def step(batches, batch_idx):
        if next(steps) == cut_at:
            raise Cut
        whole_step(batches, batch_idx)

    network.training_step = step
    fitting.fit(network, trials, replace(SETTINGS, **changed), folder, log=log)
    return network.state_dict()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return trained(tmp_path_factory.mktemp("undisturbed"))


@pytest.mark.parametrize("steps", [(1,), (6,), (7,), (8, 5), (13, 0, 1), (27,)])
def test_cut_off_in_any_step_and_resumed_the_weights_are_bit_identical(tmp_path, undisturbed, steps):
    # 204 trials make 7 steps an epoch: the cuts fall within epochs, on their first and on their last step.
    for attempt, step in enumerate(steps):
        with pytest.raises(Cut):
            trained(tmp_path, cut_at=step, attempt=attempt)
    resumed = trained(tmp_path, attempt=len(steps))
    assert all(torch.equal(resumed[name], undisturbed[name]) for name in undisturbed)


@pytest.mark.parametrize("cut_at", [1, 7, 10])
def test_a_resumed_training_says_from_which_epoch_and_keeps_its_curves(tmp_path, capsys, cut_at):
    whole, parts = {}, {}
    trained(tmp_path / "whole", log=lambda losses, epoch: whole.update({epoch: losses}), annealed=True)
    with pytest.raises(Cut):
        trained(tmp_path / "cut", cut_at, log=lambda losses, epoch: parts.update({epoch: losses}), annealed=True)
    assert "going on" not in capsys.readouterr().err
    trained(tmp_path / "cut", attempt=1, log=lambda losses, epoch: parts.update({epoch: losses}), annealed=True)
    assert f"training: going on from epoch {cut_at // 7 + 1} of at most 4\n" in capsys.readouterr().err
    assert parts == whole
    assert all(np.isfinite(losses["training_loss"]) for losses in whole.values())
    assert whole[3]["training_loss"] < whole[0]["training_loss"]


def test_a_training_goes_on_with_the_chunks_it_was_begun_with(tmp_path, undisturbed):
    with pytest.raises(Cut):
        trained(tmp_path, cut_at=3)
    resumed = trained(tmp_path, attempt=1, batches_per_chunk=5)
    assert all(torch.equal(resumed[name], undisturbed[name]) for name in undisturbed)


def test_a_finished_training_is_not_done_again(tmp_path, undisturbed, monkeypatch):
    trained(tmp_path)
    monkeypatch.setattr(fitting, "_trainer", lambda *a: pytest.fail("trained again"))
    again = trained(tmp_path)
    assert all(torch.equal(again[name], undisturbed[name]) for name in undisturbed)


def test_chunks_change_the_speed_and_nothing_else(tmp_path):
    def weights(batches_per_chunk: int) -> dict[str, torch.Tensor]:
        torch.manual_seed(0)
        network = MaskedNetwork(224, taxel_m().tolist(), hidden=8)
        skin = protocol()
        trials = network.prepare(skin, mixed(240, seed=0), WhiteNoise(skin, 1e-4), seed=0)
        settings = TrainerSettings(max_epochs=3, batches_per_chunk=batches_per_chunk, accelerator="cpu")
        fitting.fit(network, trials, settings, tmp_path / str(batches_per_chunk))
        return network.state_dict()

    one, many = weights(1), weights(5)
    assert all(torch.equal(one[name], many[name]) for name in one)


def test_training_ends_when_the_validation_loss_has_converged(tmp_path):
    network, trials = network_and_trials()
    settings = TrainerSettings(max_epochs=50, patience=2, learning_rate=0.0, accelerator="cpu")
    outcome = fitting.fit(network, trials, settings, tmp_path)
    state = torch.load(tmp_path / "last.ckpt", weights_only=True)
    assert outcome.epoch == 0
    assert state["epoch"] == 2


def test_a_loss_that_is_no_longer_finite_fails_in_one_line(tmp_path):
    network, trials = network_and_trials()
    trials.inputs[5, 3] = np.nan
    with pytest.raises(JobFailed, match="no longer finite in epoch 0"):
        fitting.fit(network, trials, SETTINGS, tmp_path)
