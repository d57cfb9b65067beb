"""How many calibration presses does a skin need? Error of touches against presses kept of a recording.

    python experiments/anywhere/few_presses/run.py DATA [WORK]

DATA holds recordings/; contacts are searched for without a network, but where one is trained on the presses kept.
WORK (runs/few_presses) keeps what is done, thinned recordings with their diagnoses among it, so that the same command
goes on where it was stopped; results so far lie beside this file after every point.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from figures import force_against_presses
from hydra import compose, initialize_config_dir
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from presses import chosen_order, gridded, places_of, random_order

from ertskin.configuration import config_dir
from ertskin.data.anywhere import anywhere
from ertskin.data.chosen_presses import presses_of
from ertskin.data.sources import calibration_path
from ertskin.data.touches import Touches, touches_of
from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.files import write_whole
from ertskin.hardware.recording import Recording, read_recording, write_recording
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.deciding import proposals
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.calibration.rest_frames import rest_scan
from ertskin.physics.sensor import Sensor
from ertskin.report.figures.image import png
from ertskin.steps import run_step

Array = NDArray[np.float64]
FOLDER = Path(__file__).parent
COUNTS = (6, 3, 12, 1, 2)
"""The one that matters first."""
DRAWS = (0, 1, 2)
LEAST_N = 0.15
EFFECTS = Path("runs/conf/effects")
"""Where ``ertskin diagnose`` writes what it found, for other commands to choose."""
DIAGNOSED = (6, 3, 12)
"""Numbers of chosen presses that are diagnosed by themselves."""


@dataclass(frozen=True)
class Rig:
    """A training recording, and those of the touches it is judged by."""

    train: str
    tests: tuple[str, ...]


RIGS = {
    "rig_a": Rig("rig_a_train", ("rig_a_test_anywhere",)),
    "rig_c": Rig("rig_c_train", ("rig_c_test_one", "rig_c_test_two")),
}


@dataclass(frozen=True)
class Point:
    """Presses kept, how they were found (``way``, ``draw``), which ``effects`` the simulator knows, and whether the
    network is trained again on them."""

    effects: str
    way: str
    draw: int
    presses: list[int]
    retrained: bool = False

    @property
    def name(self) -> str:
        """What its result is kept as."""
        again = "_retrained" if self.retrained else ""
        return f"{self.effects}_{self.way}_{self.draw}_{len(self.presses)}{again}"


def main() -> None:
    """Every point of both curves that isn't there yet."""
    torch.set_num_threads(1)
    data = Path(sys.argv[1])
    work = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("runs/few_presses")
    found: dict[str, dict[str, Any]] = {}
    for name in RIGS:
        for so_far in curve(data, name, work):
            found[name] = so_far
            write_whole(FOLDER / "results.json", json.dumps(found, indent=1))
            write_whole(FOLDER / "few_presses.png", png(force_against_presses(found)))


def curve(data: Path, name: str, work: Path) -> Iterator[dict[str, Any]]:
    """Scores of every point so far, after each."""
    rig = RIGS[name]
    source = data / "recordings" / f"{rig.train}.h5"
    recording = read_recording(source)
    order, expected = kept(work / f"{name}_order.json", lambda: ordered(recording))
    tests = {test: touches_of(read_recording(data / "recordings" / f"{test}.h5")) for test in rig.tests}
    points: list[dict[str, Any]] = []
    for point in asked(recording, order):

        def score(point: Point = point) -> dict[str, float]:
            path = thinned(recording, point.presses, work / f"{name}_{point.way}_{point.draw}_{len(point.presses)}.h5")
            simulator = known(point.effects, path, source)
            job = trained(simulator, work / f"{name}_{point.name}") if point.retrained else None
            proposed = {test: None if job is None else proposed_by(job, each) for test, each in tests.items()}
            return judged(recording.sensor, simulator, tests, proposed)

        scores = kept(work / f"{name}_{point.name}.json", score)
        print(f"{name} {point.name}: {brief(scores)}", flush=True)
        points.append({**asdict(point), "scores": scores})
        yield {"expected": dict(zip(range(1, len(expected) + 1), expected, strict=True)), "points": points}


def ordered(recording: Recording) -> tuple[list[int], list[dict[str, float]]]:
    """The presses chosen for what they tell, and the accuracy expected after each."""
    order, expected = chosen_order(recording, max(COUNTS), lambda line: print(line, flush=True))
    return order, [asdict(accuracy) for accuracy in expected]


def asked(recording: Recording, order: list[int]) -> Iterator[Point]:
    """Every point, those that matter most first."""
    everything = places_of(recording)[0]
    for effects in ("none", "of_all"):
        yield Point(effects, "all", 0, everything)
    for count in COUNTS:
        chosen = Point("none", "chosen", 0, order[:count])
        yield chosen
        if count in DIAGNOSED:
            yield replace(chosen, effects="of_these")
        yield Point("none", "gridded", 0, gridded(recording, count))
        if count == COUNTS[0]:
            yield replace(chosen, effects="of_these", retrained=True)
        for draw in DRAWS:
            yield Point("none", "random", draw, random_order(recording, draw)[:count])


def thinned(recording: Recording, presses: list[int], path: Path) -> Path:
    """The recording with some of its presses alone, written to ``path`` once: what is computed from it is kept by its
    content."""
    if not path.is_file():
        write_recording(path, presses_of(recording, presses))
    return path


@dataclass(frozen=True)
class Known:
    """What the simulator of a recording knows: the choice of ``effects`` and further words for ``ertskin train``."""

    effects: str
    words: list[str]

    def config(self) -> DictConfig:
        """As ``ertskin train`` would have it, with hardly any trials: the table of responses is wanted alone."""
        with initialize_config_dir(str(config_dir()), version_base="1.3"):
            config = compose("train", overrides=["model=contacts", "cluster.workers=1", *self.words])
        OmegaConf.update(config, "data.plan.trials", 10)
        if self.effects != "none":
            OmegaConf.set_struct(config, False)
            config.effects = OmegaConf.load(EFFECTS / f"{self.effects}.yaml")
        return config


def known(effects: str, path: Path, whole: Path) -> Known:
    """The simulator of a thinned recording, diagnosed first where it is to know effects.

    Those of the ``whole`` recording go with the calibration fitted with them, which has seen all presses too.
    """
    words = [f"recording={path}", *noise_of(read_recording(path))]
    if effects == "none":
        return Known("none", words)
    if effects == "of_these":
        return Known(diagnosed(path), words)
    of_all = Known(diagnosed(whole), [f"recording={whole}"])
    return Known(of_all.effects, [*words, f"calibration.file={calibration_path(of_all.config())}"])


def diagnosed(path: Path) -> str:
    """The choice of effects that a diagnosis of the recording has written, made once."""
    if not (EFFECTS / f"{path.stem}.yaml").is_file():
        run_step(["diagnose", f"recording={path}"])
    return path.stem


def trained(simulator: Known, out: Path) -> Path:
    """The folder of a network trained on a thinned recording."""
    run_step(["train", "model=contacts", "seed=0", *simulator.words, f"effects={simulator.effects}", f"out={out}"])
    (model,) = out.glob("*/model.pt")
    return model.parent


def proposed_by(network: Path, touches: Touches) -> Array:
    """(N,C,3) where a trained network says the contacts are: what is kept when only recalibrated."""
    found = Reconstruction.load(network / "model.pt").network
    assert isinstance(found, ContactsNetwork)
    with torch.no_grad():
        whitened = found.trunk.whiten(torch.from_numpy(touches.change_v).float())
        logit, force, offset = found.layers_out(whitened)
        votes = torch.sigmoid(logit), force, found.taxel_m + found.spacing_m * offset
    answers = (vote.double().numpy() for vote in votes)
    return proposals(*answers, found.spacing_m, found.threshold, found.most)


def judged(
    sensor: Sensor, simulator: Known, tests: dict[str, Touches], proposed: dict[str, Array | None]
) -> dict[str, float]:
    """Scores of the most likely contacts; calibration, table and its correction come from the presses kept."""
    model = anywhere(simulator.config()).trials.touch
    assert model is not None
    posterior = model.posterior(LEAST_N)
    scores: dict[str, float] = {"size": float(model.error.error[2]), "remainder": model.error.remainder}
    for test, touches in tests.items():
        beliefs = posterior.of(touches.change_v @ model.matrix, proposed[test])
        history = touches.history
        outcome = ContactOutcome(
            np.where(history.touched[..., None], history.contact_m, np.nan),
            np.where(history.touched, history.force_n, np.nan),
            beliefs.contact_m,
            beliefs.force_n,
            sensor.taxel_m,
            beliefs.covariance,
        )
        scores |= {score.name: score.value for score in contact_scores(outcome).values()}
    return scores


def noise_of(thinned: Recording) -> list[str]:
    """Where two rest frames are all there is, the noise is white, as large as they differ."""
    assert thinned.frames is not None
    assert thinned.protocol is not None
    rest_v = thinned.frames.voltage_v[thinned.frames.history.phase == 0]
    return [] if len(rest_v) > 2 else ["noise=white", f"noise.std_v={rest_scan(rest_v, thinned.protocol).noise_v}"]


def kept(path: Path, make: Any) -> Any:
    """What ``make`` gives, made once."""
    if not path.is_file():
        write_whole(path, json.dumps(make(), indent=1))
    return json.loads(path.read_text(encoding="utf-8"))


def brief(scores: dict[str, float]) -> str:
    """A line of one point's scores."""
    counts = sorted(int(key.rpartition("_")[2]) for key in scores if key.startswith("count_rate"))
    words = []
    for k in counts:
        rate, mm, newton = (scores[f"{name}_{k}"] for name in ("count_rate", "location_error_mm", "force_error_n"))
        words.append(f"{k}: {rate:.3f} {mm:.3f} mm {newton:.3f} N")
    return ", ".join(words)


if __name__ == "__main__":
    main()
