"""Training the paper's networks: our loop against a bare PyTorch loop, and the whole of it."""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import replace
from functools import partial
from itertools import accumulate
from pathlib import Path

import numpy as np
import torch
import trials
from sheets import padded_sheet

from ertskin.data.material import Material
from ertskin.data.split import split
from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.models.network import Network
from ertskin.physics.noise.white import WhiteNoise
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.training.fit import fit
from ertskin.training.reconstruct import train_reconstruction
from ertskin.training.settings import TrainerSettings

PROTOCOL = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
NOISE = WhiteNoise(PROTOCOL, trials.NOISE_V)
DENOISER_TRIALS = 2124
SETTINGS = TrainerSettings(batch=32, learning_rate=1e-3, max_epochs=100, patience=10, accelerator="cpu")


def loops(material: Material, epochs: int, turns: int) -> dict:
    """Steps a second of ``fit`` once it runs, and of bare loops, on one thread; ratios within a turn.

    Two bare loops: on the network as it is, with the trials as it takes them, and on its plain form that multiplies
    6,624 readings. Neither validates, keeps checkpoints or may stop early; ours does all three.
    """
    settings = replace(SETTINGS, max_epochs=epochs)
    rows, _ = split(len(material.trials), settings.seed)
    steps = epochs * -(-len(rows) // settings.batch)
    network = _network()
    data = network.prepare(PROTOCOL, material.trials, NOISE, settings.seed)
    # A third of the trials, thrice: all of them as readings would take a gigabyte.
    third = slice(None, None, 3)
    targets = {name: value[third] for name, value in data.targets.items()}
    readings = TrialTensors(_standardised(network, material.trials[third]), targets)
    jobs = {
        "ertskin": lambda: running(_network(), material.trials, settings),
        "bare loop": lambda: bare(network, data, rows, settings),
        "bare loop on readings": lambda: bare(OnReadings(network), readings, rows % len(readings), settings),
    }
    rates: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(turns):
        for name, job in jobs.items():
            rates[name].append(steps / job())
    ours = np.array(rates["ertskin"])
    return {
        "steps": steps,
        "turns": turns,
        **{
            name: {"steps_per_s": float(np.median(each)), "ratio": float(np.median(ours / np.array(each)))}
            for name, each in rates.items()
        },
    }


def running(network: Network, made: TrialSet, settings: TrainerSettings) -> float:
    """Seconds of ``max_epochs`` of ``fit`` after a first one: validation and checkpoints with them, the start not."""
    data = network.prepare(PROTOCOL, made, NOISE, settings.seed)
    ends: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        longer = replace(settings, max_epochs=settings.max_epochs + 1)
        fit(network, data, longer, Path(folder), log=lambda losses, epoch: ends.append(time.perf_counter()))
    return ends[-1] - ends[0]


def bare(network: torch.nn.Module, data: TrialTensors, rows: np.ndarray, settings: TrainerSettings) -> float:
    """Seconds of the shortest loop one would write: shuffled rows, fused Adam, nothing else."""
    torch.set_num_threads(settings.threads)
    optimizer = torch.optim.Adam(network.parameters(), lr=settings.learning_rate, fused=True)
    kept = torch.from_numpy(rows)
    network.train()
    begun = time.perf_counter()
    for _ in range(settings.max_epochs):
        for batch in kept[torch.randperm(len(kept))].split(settings.batch):
            losses = network.losses(data.inputs[batch], {name: value[batch] for name, value in data.targets.items()})
            optimizer.zero_grad()
            sum(losses.values()).backward()
            optimizer.step()
    return time.perf_counter() - begun


class OnReadings(MaskedNetwork):
    """The same network as it is used after training, on standardised readings."""

    def __init__(self, network: MaskedNetwork) -> None:
        super().__init__(**network.arguments)

    def trials_out(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Logits and forces from (N,R) standardised readings."""
        layer = self.readings
        return self._behind(torch.addmm(layer.bias, inputs, layer.weight))


def full(material: Material, threads: int) -> dict:
    """Wall seconds of the paper's whole training to its last epoch, and to where its patience ends."""
    settings = replace(SETTINGS, patience=SETTINGS.max_epochs, threads=threads)
    begun = time.perf_counter()
    logged: dict[str, list[tuple[float, float]]] = {"denoiser": [], "network": []}

    def log(stage: str, losses: dict[str, float], epoch: int) -> None:
        logged[stage].append((losses["validation_loss"], time.perf_counter() - begun))

    with tempfile.TemporaryDirectory() as folder:
        build = partial(MaskedNetwork, hidden=36, threshold=0.5), partial(Denoiser, hidden=128)
        train_reconstruction(material, *build, settings, Path(folder), log)
    seconds = time.perf_counter() - begun
    ends = {stage: converged([loss for loss, _ in each], SETTINGS.patience) for stage, each in logged.items()}
    last = max(each[-1][1] for each in logged.values())
    converging = max(logged[stage][end - 1][1] for stage, end in ends.items())
    return {
        "trials": len(material.trials),
        "threads": threads,
        "epochs": {stage: len(each) for stage, each in logged.items()},
        "seconds": seconds,
        "denoiser_s": logged["denoiser"][-1][1],
        "epochs_with_patience": ends,
        "seconds_with_patience": seconds - last + converging,
        "load": os.getloadavg()[0],
    }


def converged(losses: list[float], patience: int) -> int:
    """Epochs trained until ``patience`` in a row brought the loss no lower."""
    best = list(accumulate(losses, min))
    stale = 0
    for epoch, loss in enumerate(losses):
        stale = 0 if epoch == 0 or loss < best[epoch - 1] else stale + 1
        if stale == patience:
            return epoch + 1
    return len(losses)


def material(pairs: int, workers: int) -> Material:
    """The benchmark's trials as training takes them; the denoiser's are the last of the pairs, with noise."""
    made = trials.solved(pairs, workers)
    taxel_m = padded_sheet().taxel_m
    gap = np.nan_to_num(np.abs(made.contact_m[:, :, None] - taxel_m).max(axis=3), nan=np.inf)
    force_map = np.einsum("npt,np->nt", gap < 1e-9, np.nan_to_num(made.force_n))
    every = TrialSet(made.pair_ohm - made.rest_ohm, force_map, made.contact_m, made.force_n)
    return Material(PROTOCOL, taxel_m, every, NOISE, "benchmark", every[slice(-DENOISER_TRIALS, None)])


def _network() -> MaskedNetwork:
    torch.manual_seed(SETTINGS.seed)
    return MaskedNetwork(PROTOCOL.design.shape[0], padded_sheet().taxel_m.tolist())


def _standardised(network: MaskedNetwork, made: TrialSet) -> torch.Tensor:
    return network.scaled(torch.from_numpy(made.readings_v(PROTOCOL)))
