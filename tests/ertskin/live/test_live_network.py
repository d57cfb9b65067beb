"""The exported network: the same answers as the checkpoint, without torch, fast."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from ertskin.errors import UserError
from ertskin.live.export import export_onnx
from ertskin.live.predictor import Predictor
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.models.network import Network
from ertskin.models.places import PlacesNetwork
from ertskin.models.reciprocal import ReciprocalNetwork
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import taxel_grid_m

ELECTRODES = 8
PROTOCOL = Protocol.against_sink(electrode_pairs(ELECTRODES), ELECTRODES, 1e-4)
TAXEL_M = taxel_grid_m((0.12, 0.12), 3, 3).tolist()
READINGS, PAIRS = 28 * 8, 28


def reconstruction(kind: str) -> Reconstruction:
    """A network with random weights and scalings, in a state as after training."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    denoiser = None
    network: Network
    if kind in ("masked", "paper"):
        network = MaskedNetwork(READINGS, TAXEL_M, hidden=12, threshold=0.3)
        network.scale.fit(1e-3 * rng.normal(size=READINGS), 1e-3 * (0.5 + rng.random(READINGS)))
        if kind == "paper":
            denoiser = Denoiser(READINGS, hidden=16)
            denoiser.scale.fit(1e-3 * rng.normal(size=READINGS), 1e-3 * (0.5 + rng.random(READINGS)))
    else:
        network = (ReciprocalNetwork if kind == "reciprocal" else PlacesNetwork)(
            PAIRS, TAXEL_M, components=16, width=24, threshold=0.3
        )
        network.trunk.whiten.fit(1e-2 * rng.normal(size=(500, PAIRS)), 1e-6 * np.eye(PAIRS))
        if isinstance(network, ReciprocalNetwork):
            network.single.curve.copy_(torch.randn(network.single.curve.shape).cumsum(dim=1))
            network.single.force_n.copy_(torch.linspace(0.0, 8.0, len(network.single.force_n)))
            network.single.known.fill_(1.0)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm1d):
            module.running_mean.copy_(torch.randn(module.num_features))
            module.running_var.copy_(torch.rand(module.num_features) + 0.5)
    return Reconstruction(PROTOCOL, network.eval(), None if denoiser is None else denoiser.eval())


def changes(frames: int = 40) -> np.ndarray:
    """(N,28,8) changes of the readings, some small, some large."""
    rng = np.random.default_rng(1)
    return (10.0 ** rng.uniform(-3, -1, (frames, 1, 1)) * rng.normal(size=(frames, 28, 8))).astype(np.float32)


@pytest.mark.parametrize("kind", ["masked", "paper", "reciprocal", "places"])
def test_answers_as_the_checkpoint_does(kind: str, tmp_path: Path) -> None:
    model = reconstruction(kind)
    export_onnx(model, tmp_path / "model.onnx")
    mine, wanted = Predictor(tmp_path / "model.onnx").estimate(changes()), model.estimate(changes())
    assert wanted.present.any()
    np.testing.assert_array_equal(mine.present, wanted.present)
    scale = max(1.0, float(np.abs(wanted.force_map_n).max()))
    np.testing.assert_allclose(mine.force_map_n, wanted.force_map_n, atol=2e-4 * scale)
    if wanted.contact_m is not None:
        assert mine.contact_m is not None
        np.testing.assert_allclose(mine.contact_m, wanted.contact_m, atol=1e-5)
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.onnx"]


@pytest.mark.parametrize("kind", ["masked", "reciprocal", "places"])
def test_answers_alike_from_coordinates(kind: str, tmp_path: Path) -> None:
    export_onnx(reconstruction(kind), tmp_path / "model.onnx")
    predictor = Predictor(tmp_path / "model.onnx")
    assert predictor.reads_coordinates == (kind != "masked")
    if predictor.reads_coordinates:
        coordinates_v = changes().reshape(-1, READINGS).astype(float) @ PROTOCOL.orthonormal
        mine, wanted = predictor.estimate_coordinates(coordinates_v), predictor.estimate(changes())
        np.testing.assert_array_equal(mine.present, wanted.present)
        np.testing.assert_allclose(mine.force_map_n, wanted.force_map_n, atol=2e-4 * np.abs(wanted.force_map_n).max())


@pytest.mark.parametrize("kind", ["paper", "reciprocal", "places"])
def test_runs_where_there_is_no_torch(kind: str, tmp_path: Path) -> None:
    model = reconstruction(kind)
    export_onnx(model, tmp_path / "model.onnx")
    np.save(tmp_path / "change.npy", changes())
    script = (
        "import sys; sys.modules['torch'] = sys.modules['lightning'] = None\n"
        "import json, numpy as np\n"
        "from pathlib import Path\n"
        "from ertskin.live.predictor import Predictor\n"
        "estimate = Predictor(Path(sys.argv[1])).estimate(np.load(sys.argv[2]))\n"
        "print(json.dumps(estimate.force_map_n.tolist()))\n"
    )
    words = [sys.executable, "-c", script, str(tmp_path / "model.onnx"), str(tmp_path / "change.npy")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    wanted = model.estimate(changes()).force_map_n
    np.testing.assert_allclose(json.loads(done.stdout), wanted, atol=2e-4 * max(1.0, float(np.abs(wanted).max())))


def test_what_is_no_model_is_reported(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("nothing")
    for path in (tmp_path / "absent.onnx", tmp_path / "text.onnx"):
        with pytest.raises(UserError, match="model"):
            Predictor(path)


def test_a_frame_takes_less_than_a_millisecond_of_one_core(tmp_path: Path) -> None:
    """The paper's scan of 276 x 24 through the largest of our networks; processor time, as the machine is shared."""
    protocol = Protocol.against_sink(electrode_pairs(24), 24, 1e-4)
    network = ReciprocalNetwork(276, taxel_grid_m((0.12, 0.12), 6, 6).tolist()).eval()
    export_onnx(Reconstruction(protocol, network), tmp_path / "model.onnx")
    predictor = Predictor(tmp_path / "model.onnx")
    scan, rest = np.random.default_rng(0).normal(size=(2, 276, 24)).astype(np.float32)
    taken = []
    for _ in range(300):
        begin = time.thread_time()
        predictor.estimate((scan - rest)[None])
        taken.append(time.thread_time() - begin)
    assert np.median(taken) < 1e-3
