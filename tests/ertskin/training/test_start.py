"""A training that starts from the network of another specimen."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import TEST_CONF

from ertskin import cli
from ertskin.data.anywhere import touch_model
from ertskin.data.material import Material
from ertskin.data.trials import TrialSet
from ertskin.errors import UserError
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.reciprocal import ReciprocalNetwork
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.noise import WhiteNoise
from ertskin.physics.noise.directions import nearest_directions, noise_directions
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.training.reconstruct import train_reconstruction
from ertskin.training.settings import TrainerSettings

sys.path.insert(0, str(Path(__file__).parents[2] / "physics" / "touch"))
from toy_skin import EXTENT_M, response, toy_table

COMMON = ["--config-dir", str(TEST_CONF), "data=resistor_sheet", "recording=null", "trainer.accelerator=cpu"]
SMALL = ["model=reciprocal", "model.network.width=32"]
PROTOCOL = Protocol.against_sink(electrode_pairs(10), 10, 1.0)
PAD = np.eye(42, 45)
"""The toy skin's 42 answers as pair resistances, of which there are 45."""
TAXEL_M = np.stack(np.meshgrid([0.02, 0.04, 0.06], [0.02, 0.04]), axis=-1).reshape(-1, 2)


def train(*words: str) -> int:
    return cli.main(["train", *COMMON, *SMALL, *words])


def jobs() -> list[Path]:
    return sorted(Path("runs/train").iterdir(), key=lambda folder: (folder / "done.json").stat().st_mtime)


def test_a_job_is_named_by_what_it_started_from(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert train("trainer.max_epochs=4") == 0
    (first,) = jobs()
    assert train("trainer.max_epochs=4", f"from={first}", "tune_epochs=1") == 0
    assert len(jobs()) == 2
    tuned = jobs()[1]
    afresh, other = Reconstruction.load(first / "model.pt"), Reconstruction.load(tuned / "model.pt")
    before, after = (torch.cat([p.ravel() for p in each.network.parameters()]) for each in (afresh, other))
    assert 0 < (after - before).norm() < 0.3 * before.norm()
    # The same file elsewhere is the same start; the job is not done again.
    capsys.readouterr()
    moved = workplace / "kept.pt"
    moved.write_bytes((first / "model.pt").read_bytes())
    assert train("trainer.max_epochs=4", f"from={moved}", "tune_epochs=1") == 0
    assert "done before" in capsys.readouterr().out
    # As does the run of MLflow.
    assert train("trainer.max_epochs=4", f"from={afresh.about['run_id']}", "tune_epochs=1") == 0
    assert "done before" in capsys.readouterr().out
    for words, expected in (
        (["from=nowhere"], "nowhere"),
        ([f"from={first}", "tune_epochs=-1"], "tune_epochs must be at least 0"),
        ([f"from={first}", "tune_epochs=0"], "only those of model=contacts"),
        ([f"from={first}", "model=places"], "holds a ReciprocalNetwork"),
        ([f"from={first}", "model.network.width=64"], "width 32 instead of 64"),
    ):
        assert train(*words) == 2, words
        error = capsys.readouterr().err.strip().splitlines()
        assert expected in error[-1]


def test_kept_directions_are_white_in_the_new_noise_and_near_the_old() -> None:
    rng = np.random.default_rng(0)
    values, factor = rng.standard_normal((300, 12)), rng.standard_normal((12, 12))
    old, _ = noise_directions(values, np.eye(12))
    covariance = np.eye(12) + 0.02 * factor @ factor.T
    new, _ = noise_directions(values, covariance)
    kept = new @ nearest_directions(new, old[:, :5])
    floor = 1e-6 * np.mean(values**2)
    np.testing.assert_allclose(kept.T @ (covariance + floor * np.eye(12)) @ kept, np.eye(5), atol=1e-9)
    assert np.linalg.norm(kept - old[:, :5]) < 0.3 * np.linalg.norm(old[:, :5])
    np.testing.assert_allclose(old @ nearest_directions(old, old[:, :5]), old[:, :5], atol=1e-9)


def touched_anywhere(stronger: float, noise_v: float) -> Material:
    """Trials on a toy skin that answers so many times as strongly."""
    table = replace(toy_table().seen(stronger * PAD), read=np.eye(45))
    noise = WhiteNoise(PROTOCOL, noise_v)
    model = touch_model(PROTOCOL, table, noise, None, correct=False).strongest(24)
    rng = np.random.default_rng(3)
    contact_m = rng.uniform(EXTENT_M[0], EXTENT_M[1], (800, 1, 2))
    force_n = rng.uniform(0.5, 5.0, (800, 1))
    change_ohm = stronger * response(contact_m[:, 0], force_n[:, 0]) @ PAD
    trials = TrialSet(change_ohm, np.zeros((800, len(TAXEL_M))), contact_m, force_n, touch=model)
    return Material(PROTOCOL, TAXEL_M, trials, noise, "toy")


def test_another_specimens_proposals_serve_recalibrated(tmp_path: Path) -> None:
    settings = TrainerSettings(max_epochs=6, patience=6)
    build = partial(ContactsNetwork, components=24, width=48, blocks=1, most=2)
    learned, _ = train_reconstruction(touched_anywhere(1.0, 3.0), build, None, settings, tmp_path / "one")
    other = touched_anywhere(1.3, 4.5)
    kept, fitted = train_reconstruction(
        other, build, None, TrainerSettings(max_epochs=0), tmp_path / "other", start=learned
    )
    assert fitted == {}
    for name, value in learned.network.named_parameters():
        torch.testing.assert_close(value, dict(kept.network.named_parameters())[name])
    rng = np.random.default_rng(5)
    contact_m, force_n = rng.uniform(EXTENT_M[0] + 0.01, EXTENT_M[1] - 0.01, (40, 2)), rng.uniform(1.0, 4.0, 40)
    reading_v = PROTOCOL.whitened(1.3 * response(contact_m, force_n) @ PAD) + 4.5 * rng.standard_normal((40, 45))
    found = kept.estimate_coordinates(reading_v)
    assert found.contact_m is not None
    assert found.contact_force_n is not None
    assert (np.isfinite(found.contact_force_n).sum(axis=1) == 1).mean() > 0.9
    assert np.median(np.linalg.norm(found.contact_m[:, 0] - contact_m, axis=1)) < 1e-3
    assert np.median(np.abs(found.contact_force_n[:, 0] - force_n)) < 0.1
    wrong = learned.estimate_coordinates(reading_v)
    assert wrong.contact_force_n is not None
    assert np.median(np.abs(wrong.contact_force_n[:, 0] - force_n)) > 0.3


def test_networks_of_other_sizes_are_refused() -> None:
    one, other = (ReciprocalNetwork(45, TAXEL_M.tolist(), components=16, width=width) for width in (24, 32))
    with pytest.raises(UserError, match="width 24 instead of 32"):
        other.start_from(one)
    with pytest.raises(UserError, match="holds a ReciprocalNetwork"):
        ContactsNetwork(45, TAXEL_M.tolist()).start_from(one)
