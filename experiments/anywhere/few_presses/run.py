"""How many calibration presses does a skin need? Error of touches against presses kept of a recording.

    python experiments/anywhere/few_presses/run.py DATA NETWORK EFFECTS [WORK]

DATA holds recordings/; NETWORK is the folder of a ``model=contacts`` job trained on all of rig_a_train, which proposes;
EFFECTS the YAML that ``ertskin diagnose`` wrote for rig_a_train. WORK (runs/few_presses) keeps what is done, so that
the same command goes on where it was stopped; results so far lie beside this file after every point.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from figures import force_against_presses
from hydra import compose, initialize_config_dir
from numpy.typing import NDArray
from omegaconf import OmegaConf
from presses import chosen_order, gridded, places_of, random_order

from ertskin import diagnose
from ertskin.configuration import config_dir
from ertskin.data.anywhere import anywhere
from ertskin.data.chosen_presses import presses_of
from ertskin.data.touches import Touches, touches_of
from ertskin.evaluation.contact_outcome import ContactOutcome
from ertskin.evaluation.metrics.contacts import contact_scores
from ertskin.files import write_whole
from ertskin.hardware.recording import Recording, read_recording, write_recording
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.deciding import proposals
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.calibration.rest_frames import rest_scan
from ertskin.physics.effects.registry import effects_config
from ertskin.report.figures.image import png

Array = NDArray[np.float64]
HERE = Path(__file__).parent
COUNTS = (6, 3, 12, 1, 2)
"""The one that matters first."""
DRAWS = (0, 1, 2)
LEAST_N = 0.15
TABLE = ("data.table.spacing_m=0.005", "data.table.forces=6")
"""Coarser than the default: splines miss the response by 1.1 % (median) instead of 0.5 %, in half the time."""


@dataclass(frozen=True)
class Rig:
    """A training recording, the touches it is judged by, and whether a network proposes where they are."""

    train: str
    tests: tuple[str, ...]
    proposed: bool


RIGS = {
    "rig_a": Rig("rig_a_train", ("rig_a_test_anywhere",), True),
    "rig_c": Rig("rig_c_train", ("rig_c_test_one", "rig_c_test_two"), False),
}


def main() -> None:
    """Every point of both curves that isn't there yet."""
    torch.set_num_threads(1)
    data, network, effects = (Path(word) for word in sys.argv[1:4])
    work = Path(sys.argv[4]) if len(sys.argv) > 4 else Path("runs/few_presses")
    found: dict[str, dict[str, Any]] = {}
    for name in RIGS:
        for so_far in curve(data, name, network, effects, work):
            found[name] = so_far
            write_whole(HERE / "results.json", json.dumps(found, indent=1))
            write_whole(HERE / "few_presses.png", png(force_against_presses(found["rig_a"])))


def curve(data: Path, name: str, network: Path, effects: Path, work: Path) -> Iterator[dict[str, Any]]:
    """Scores by effects, way of choosing and number of presses, after every point."""
    rig = RIGS[name]
    recording = read_recording(data / "recordings" / f"{rig.train}.h5")
    order, expected = kept(work / f"{name}_order.json", lambda: ordered(recording))
    tests = {test: touches_of(read_recording(data / "recordings" / f"{test}.h5")) for test in rig.tests}
    proposed = {test: proposed_by(network, touches) if rig.proposed else None for test, touches in tests.items()}
    points: list[dict[str, Any]] = []
    for said, way, draw, which in asked(recording, order, rig.proposed):
        path = work / f"{name}_{said}_{way}_{draw}_{len(which)}.json"

        def score(which: list[int] = which, said: str = said) -> dict[str, float]:
            return judged(recording, which, named(said, recording, which, effects, work), tests, proposed, work)

        scores = kept(path, score)
        print(f"{name} effects {said} {way} {draw} {len(which)}: {brief(scores)}", flush=True)
        points.append({"effects": said, "way": way, "draw": draw, "presses": which, "scores": scores})
        yield {"expected": dict(zip(range(1, len(expected) + 1), expected, strict=True)), "points": points}


def named(said: str, recording: Recording, which: list[int], verdict: Path, work: Path) -> dict[str, Any]:
    """Effects: none, those in the file ``verdict``, or what a diagnosis finds in the presses ``which`` alone."""
    if said == "own":
        return dict(
            kept(
                work / f"own_{len(which)}.json", lambda: effects_config(diagnose(presses_of(recording, which)).effects)
            )
        )
    return {} if said == "none" else dict(yaml.safe_load(verdict.read_text(encoding="utf-8")))


def ordered(recording: Recording) -> tuple[list[int], list[dict[str, float]]]:
    """The presses chosen for what they tell, and the accuracy expected after each."""
    order, expected = chosen_order(recording, max(COUNTS), lambda line: print(line, flush=True))
    return order, [asdict(accuracy) for accuracy in expected]


def asked(recording: Recording, order: list[int], verdict: bool) -> Iterator[tuple[str, str, int, list[int]]]:
    """Effects, way of choosing, draw and presses of every point."""
    everything = places_of(recording)[0]
    effects = ("none", "verdict") if verdict else ("none",)
    for said in effects:
        yield said, "all", 0, everything
    if verdict:
        yield "own", "chosen", 0, order[:6]
    for count in COUNTS:
        for said in effects:
            yield said, "chosen", 0, order[:count]
        yield "none", "gridded", 0, gridded(recording, count)
        for draw in DRAWS:
            yield "none", "random", draw, random_order(recording, draw)[:count]


def proposed_by(network: Path, touches: Touches) -> Array:
    """(N,C,3) where a network trained on all presses says the contacts are: what is kept when only recalibrated."""
    trained = Reconstruction.load(network / "model.pt").network
    assert isinstance(trained, ContactsNetwork)
    with torch.no_grad():
        whitened = trained.trunk.whiten(torch.from_numpy(touches.change_v).float())
        logit, force, offset = trained.layers_out(whitened)
        votes = torch.sigmoid(logit), force, trained.taxel_m + trained.spacing_m * offset
    answers = (vote.double().numpy() for vote in votes)
    return proposals(*answers, trained.spacing_m, trained.threshold, trained.most)


def judged(
    recording: Recording,
    which: list[int],
    effects: dict[str, Any],
    tests: dict[str, Touches],
    proposed: dict[str, Array | None],
    work: Path,
) -> dict[str, float]:
    """Scores of the most likely contacts; calibration, table and its correction come from the presses ``which``."""
    path = work / "thinned.h5"
    thinned = presses_of(recording, which)
    write_recording(path, thinned, overwrite=True)
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        words = [
            "model=contacts",
            f"recording={path}",
            "cluster.workers=1",
            "data.plan.trials=10",
            *TABLE,
            *noise_of(thinned),
        ]
        folders = [f"data.folder={work / 'tables'}", f"calibration.folder={work / 'calibrate'}"]
        config = compose("train", overrides=[*words, *folders])
    if effects:
        OmegaConf.set_struct(config, False)
        config.effects = OmegaConf.create(effects)
    model = anywhere(config).trials.touch
    shutil.rmtree(work / "tables")
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
            recording.sensor.taxel_m,
            beliefs.covariance,
        )
        scores |= {score.name: score.value for score in contact_scores(outcome).values()}
    return scores


def noise_of(recording: Recording) -> list[str]:
    """Where two rest frames are all there is, the noise is white, as large as they differ."""
    assert recording.frames is not None
    assert recording.protocol is not None
    rest_v = recording.frames.voltage_v[recording.frames.history.phase == 0]
    return [] if len(rest_v) > 2 else ["noise=white", f"noise.std_v={rest_scan(rest_v, recording.protocol).noise_v}"]


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
