"""Simulate the trials a network learns from: 3600 one-point, 32400 two-point, 1800 for the denoiser by default.

Kept in shards with checksums; killed and started again it goes on. ``train`` does the same by itself.
"""

from __future__ import annotations

from pathlib import Path

from omegaconf import DictConfig


def run(config: DictConfig) -> None:
    """Synthesize what is missing of ``config.data`` and say where it is."""
    from ertskin.hardware.recording import read_recording

    recording = read_recording(Path(config.recording))  # Refused before what follows loads for seconds.

    from ertskin.data.simulated import simulated_trials

    made = simulated_trials(config, recording)
    count = len(made.network)
    single = int((made.network.contacts == 1).sum())
    print(f"{single} one-point and {count - single} many-point trials, {len(made.denoiser)} for the denoiser")
    print(f"  {made.folder}\n  checksum {made.checksum}")
