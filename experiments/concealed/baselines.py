"""What stands beside the diagnosis and names nothing: recalibration, a residual network, a Gaussian process.

``python experiments/concealed/baselines.py NAME RECORDING OUT`` writes OUT/diagnosis.json. They calibrate as ``ertskin
calibrate`` does; two of them learn the residual of every other press from place, force and history, and are judged on
the presses between. ``rivals.py`` begins from the diagnosis's own calibration instead.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from ertskin.calibration.fit import fit_recording  # noqa: E402
from ertskin.data.baseline import rest_weights  # noqa: E402
from ertskin.data.skin_forward import SkinForward  # noqa: E402
from ertskin.data.touches import touches_of  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402
from ertskin.physics.history import History, Phase  # noqa: E402

Array = NDArray[np.float64]
MATERIAL = 1.05
COMPONENTS = 20


@dataclass(frozen=True, eq=False)
class Residual:
    """What calibration leaves: N touched frames, P whitened coordinates in units of the noise.

    ``features`` (N,F), ``fitted`` (N,) frames of the presses learned from; ``noise_v`` of one reading.
    """

    wrong: Array
    features: Array
    fitted: NDArray[np.bool_]
    noise_v: float

    def ratio(self, explained: Array | float = 0.0) -> float:
        """Residual rms over noise rms on the presses held out."""
        return float(np.sqrt(np.mean((self.wrong - explained)[~self.fitted] ** 2)))


def residual(path: Path) -> Residual:
    """Calibrate on the recording and compare its presses with the model."""
    recording = read_recording(path)
    calibration, _ = fit_recording(recording, path.name, resolution="fine")
    touches = touches_of(recording)
    if recording.frames is None:
        raise SystemExit(f"{path}: no frames")
    history, rest = touches.history, touches.rest_v.reshape(len(touches.rest_v), -1)
    forward = SkinForward(calibration, touches.protocol, {}, "fine")
    model = touches.protocol.whitened(forward.change_ohm(history.contact_m, history.force_n))
    noise = float(np.diff(rest, axis=0).std() / np.sqrt(2.0))
    whole = recording.frames.history
    weights = rest_weights(whole, np.zeros((len(whole), 1)))[whole.touched.any(axis=1)]
    spread = noise * np.sqrt(1.0 + (weights**2).sum(axis=1, keepdims=True))
    order = np.unique(history.press, return_inverse=True)[1]
    return Residual((touches.change_v - model) / spread, _features(history), order % 2 == 0, noise)


def _features(history: History) -> Array:
    """Place, force, which way the stage goes, time since the press began, time of day; each of unit spread."""
    begin = np.array([history.time_s[history.press == press].min() for press in history.press])
    unloading = (history.phase == Phase.UNLOADING).astype(float)
    columns = [history.contact_m[:, 0, 0], history.contact_m[:, 0, 1], history.force_n[:, 0], unloading]
    columns += [np.log1p(history.time_s - begin), history.time_s]
    table = np.stack(columns, axis=1)
    spread = table.std(axis=0)
    return (table - table.mean(axis=0)) / np.where(spread > 0, spread, 1.0)


def _learned(left: Residual, regressor: Any) -> Array:
    """(N,P) what a regressor makes of the residual, through its main components on the presses learned from."""
    seen = left.wrong[left.fitted]
    basis = np.linalg.svd(seen, full_matrices=False)[2][:COMPONENTS]
    size = (seen @ basis.T).std(axis=0)
    regressor.fit(left.features[left.fitted], seen @ basis.T / size)
    return (regressor.predict(left.features) * size) @ basis


def recalibration(left: Residual) -> Array | float:
    """Nothing but the calibration."""
    return 0.0


def residual_network(left: Residual) -> Array | float:
    """A small network from place, force and history to the residual."""
    from sklearn.neural_network import MLPRegressor

    # A few hundred frames: regularised, and descended to the end rather than stopped by a tenth of them.
    network = MLPRegressor(hidden_layer_sizes=(64, 64), solver="lbfgs", alpha=3.0, max_iter=2000, random_state=0)
    return _learned(left, network)


def gaussian_process(left: Residual) -> Array | float:
    """Kennedy and O'Hagan's discrepancy: a Gaussian process of place, force and history."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel

    kernel = 1.0 * RBF(np.ones(left.features.shape[1]), (1e-1, 1e2)) + WhiteKernel(0.3, (1e-3, 1e1))
    return _learned(left, GaussianProcessRegressor(kernel, random_state=0))


BASELINES: dict[str, Callable[[Residual], Array | float]] = {
    "recalibration": recalibration,
    "residual_network": residual_network,
    "gaussian_process": gaussian_process,
}


def verdict(name: str, path: Path) -> dict[str, Any]:
    """The contract's dictionary: these methods can say that something is missing, not what."""
    try:
        left = residual(path)
    except RuntimeError as error:
        return _said(path, "cannot_tell", {"split": f"none: {error}"})
    before, after = left.ratio(), left.ratio(BASELINES[name](left))
    held_out = {"split": "every other press", "noise_rms_v": left.noise_v, "ratio_before": before, "ratio_after": after}
    return _said(path, "unexplained" if before > MATERIAL else "no_mismatch", held_out)


def _said(path: Path, word: str, held_out: dict[str, Any]) -> dict[str, Any]:
    return {
        "format": "ertskin-diagnosis",
        "format_version": 1,
        "recording": path.name,
        "verdict": word,
        "held_out": held_out,
        "where": {"stage": None, "electrodes": [], "position_m": None, "radius_m": None, "depends_on": []},
        "effects": [],
        "unexplained": {"ratio": held_out.get("ratio_after"), "depends_on": []},
        "next_press": None,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=BASELINES)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    found = verdict(options.name, options.recording)
    options.out.mkdir(parents=True, exist_ok=True)
    aside = options.out / "diagnosis.json.part"
    aside.write_text(json.dumps(found, indent=1) + "\n")
    os.replace(aside, options.out / "diagnosis.json")
    print(f"{options.recording.name}: {found['verdict']}, held out {found['held_out']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
