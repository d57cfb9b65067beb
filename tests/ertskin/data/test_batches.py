"""What is drawn depends on the seed and the epoch, and on nothing else."""

import torch

from ertskin.data.batches import Batches, Chunks, InOrder
from ertskin.data.split import split
from ertskin.data.tensors import TrialTensors


def chunks(noise=None, seed=0) -> Chunks:
    values = torch.arange(50, dtype=torch.float32)
    trials = TrialTensors(values[:, None], {"value": values}, noise)
    return Chunks(trials, torch.arange(10, 50), batch=4, batches=3, seed=seed)


def inputs_of(chunk: Batches) -> torch.Tensor:
    return torch.cat([inputs[:, 0] for inputs, _ in chunk])


def values_of(chunk: Batches) -> torch.Tensor:
    return torch.cat([targets["value"] for _, targets in chunk])


def test_every_trial_comes_once_an_epoch_beside_its_own_target():
    drawn = list(chunks())
    inputs = torch.cat([inputs_of(chunk) for chunk in drawn])
    assert len(drawn) == 4
    assert inputs.sort().values.tolist() == list(range(10, 50))
    assert torch.equal(inputs, torch.cat([values_of(chunk) for chunk in drawn]))
    assert [len(batch) for batch, _ in drawn[0]] == [4, 4, 4]


def test_epochs_differ_and_seeds_differ():
    loader = chunks()
    first, second, other = (torch.cat([inputs_of(c) for c in x]) for x in (loader, loader, chunks(seed=1)))
    assert not torch.equal(first, second)
    assert not torch.equal(first, other)
    assert torch.equal(first, torch.cat([inputs_of(c) for c in chunks()]))


def test_a_loader_restored_in_the_middle_goes_on_with_the_next_chunk():
    bank = torch.randn(20, 1, generator=torch.Generator().manual_seed(0))
    loader = chunks(bank)
    whole = [inputs_of(chunk) for _ in range(2) for chunk in loader]
    for done in range(len(whole)):
        started, seen = chunks(bank), 0
        while seen < done:
            for _ in started:
                seen += 1
                if seen == done:
                    break
        resumed = chunks(bank)
        resumed.load_state_dict(started.state_dict())
        assert torch.equal(inputs_of(next(iter(resumed))), whole[done])


def added(loader: Chunks) -> dict[float, float]:
    """Noise each trial was given in the next epoch."""
    return {
        v: i - v for chunk in loader for i, v in zip(inputs_of(chunk).tolist(), values_of(chunk).tolist(), strict=True)
    }


def test_noise_is_added_anew_each_epoch_in_training_and_stays_in_validation():
    bank = torch.tensor([[0.25], [0.5]])
    loader = chunks(bank)
    first, second = (added(loader), added(loader))
    assert set(first.values()) == {0.25, 0.5}
    assert first != second
    held = InOrder(loader.trials, torch.arange(10))
    assert torch.equal(inputs_of(next(iter(held))), inputs_of(next(iter(held))))


def test_a_last_batch_of_one_trial_is_left_out():
    loader = chunks()
    loader.rows = torch.arange(13)
    assert [len(batch) for chunk in loader for batch, _ in chunk] == [4, 4, 4]


def test_the_split_is_disjoint_complete_and_seeded():
    training, validation = split(100, seed=4)
    assert len(training) == 85
    assert sorted([*training, *validation]) == list(range(100))
    assert (split(100, seed=4)[0] == training).all()
    assert (split(100, seed=5)[0] != training).any()
