"""A network from a checkpoint, a job's folder, ONNX and an MLflow run: the same touches for the same frames."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import ertskin
from ertskin.models.reconstruction import Reconstruction

sys.path.insert(0, str(Path(__file__).parents[1] / "live"))
from test_live_network import PROTOCOL, reconstruction


@pytest.fixture(scope="module")
def job(tmp_path_factory) -> Path:
    """A job's folder with a checkpoint and its export."""
    from ertskin.live.export import export_onnx

    folder = tmp_path_factory.mktemp("job")
    model = reconstruction("places")
    model.save(folder / "model.pt")
    export_onnx(model, folder / "model.onnx")
    return folder


def scans(seed: int = 0, frames: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Touched and untouched scans with a microvolt of noise."""
    rng = np.random.default_rng(seed)
    rest_v = 1.0 + 1e-6 * rng.normal(size=(4, 28, 8))
    pairs_ohm = rng.normal(scale=500.0, size=(frames, 28))
    return rest_v.mean(axis=0) + PROTOCOL.readings(pairs_ohm), rest_v


def test_three_lines_from_a_folder_to_touches(job: Path) -> None:
    frames_v, rest_v = scans()
    touches = ertskin.load_network(job).predict(frames_v, rest_v)
    expected = Reconstruction.load(job / "model.pt").estimate(frames_v - rest_v.mean(axis=0))
    assert touches.present.any()
    np.testing.assert_array_equal(touches.force_map_n, expected.force_map_n)
    np.testing.assert_array_equal(touches.contact_m, expected.contact_m)


@pytest.mark.parametrize("file", ["model.pt", "model.onnx"])
def test_checkpoint_and_graph_say_the_same(job: Path, file: str) -> None:
    frames_v, rest_v = scans()
    network = ertskin.load_network(job / file)
    assert network.shape == (28, 8)
    assert network.taxel_m.shape == (9, 2)
    forces = network.predict(frames_v, rest_v).force_map_n
    np.testing.assert_allclose(forces, ertskin.load_network(job).predict(frames_v, rest_v).force_map_n, atol=1e-4)


def test_a_run_of_mlflow(workplace: Path, job: Path) -> None:
    from ertskin.tracking.model import log_model
    from ertskin.tracking.run import Run
    from ertskin.tracking.settings import TrackingSettings

    settings = TrackingSettings(Path("runs/mlflow.db"), Path("runs/artifacts"), "ertskin")
    with Run.begin(settings, "key", "name") as run:
        log_model(run, job / "model.pt")
    frames_v, rest_v = scans()
    touches = ertskin.load_network(f"runs:/{run.run_id}").predict(frames_v, rest_v)
    np.testing.assert_array_equal(touches.force_map_n, ertskin.load_network(job).predict(frames_v, rest_v).force_map_n)
    with pytest.raises(ertskin.UserError, match="run 0123 has no"):
        ertskin.load_network("runs:/0123")


def test_the_first_frame_is_the_rest_where_none_is_given(job: Path) -> None:
    network = ertskin.load_network(job)
    frames_v, rest_v = scans()
    together = np.concatenate([rest_v[:1], frames_v])
    np.testing.assert_allclose(
        network.predict(together).force_map_n[1:], network.predict(frames_v, rest_v[0]).force_map_n, atol=1e-5
    )


def test_a_single_scan_and_untouched_scans(job: Path) -> None:
    network = ertskin.load_network(job)
    frames_v, rest_v = scans()
    assert network.predict(frames_v[0], rest_v).force_map_n.shape == (1, 9)
    noise_alone = rest_v.mean(axis=0) + 1e-6 * np.random.default_rng(1).normal(size=(20, 28, 8))
    untouched = network.predict(noise_alone, rest_v)
    assert not untouched.present.any()
    assert not untouched.force_map_n.any()
    assert np.isnan(untouched.contact_m).all()


def test_frames_of_another_scan_are_refused(job: Path) -> None:
    with pytest.raises(ertskin.UserError, match=r"frames_v has shape \(5, 16, 13\), .* \(N, 28, 8\)"):
        ertskin.load_network(job).predict(np.zeros((5, 16, 13)))


@pytest.mark.parametrize("file", ["model.pt", "model.onnx"])
def test_no_network_there(tmp_path: Path, file: str) -> None:
    with pytest.raises(ertskin.UserError, match="no model at"):
        ertskin.load_network(tmp_path / file)
