"""The main job: from a recording to calibrated networks, their comparison and a report.

With ``recording=FILE`` and its tests ``one=FILE two=FILE``, or without any on a simulated bench. Every step is a
command a person could type, and prints as such; what is done already is not done again.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from ertskin.data.shards import request_key
from ertskin.errors import JobFailed, UserError

KINDS = {"recording": "indentation", "one": "test_one", "two": "test_two"}
"""Role of a recording in the job, and the bench's plan for it."""


def run(config: DictConfig) -> None:
    """Record (on the bench, unless a recording is given), calibrate, synthesize, train, evaluate."""
    begun = time.monotonic()
    files = _recordings(config)
    recording = f"recording={files['recording']}"
    tests = [f"{role}={files[role]}" for role in ("one", "two") if files[role] is not None]
    settings = _handed_on()
    _step(["doctor", recording])
    _step(["calibrate", recording, *_accepted("calibrate", settings)])
    _step(["synthesize", recording, *_accepted("synthesize", settings)])
    sweep = [f"model={','.join(config.models)}", f"seed={','.join(map(str, config.seeds))}"]
    launcher = ["hydra/launcher=joblib", f"hydra.launcher.n_jobs={config.jobs}"] if config.jobs > 1 else []
    _step(["train", "-m", recording, *sweep, *_accepted("train", settings), *launcher])
    if tests:
        _step(["evaluate", recording, *tests, *_accepted("evaluate", settings)])
    else:
        print("no test recording given (one=FILE two=FILE): nothing to evaluate on")
    print(f"\ndone in {time.monotonic() - begun:.0f} s; compare the runs with: ertskin dashboard")


def _handed_on() -> list[str]:
    """What was typed that isn't a setting of this command itself."""
    from hydra.core.hydra_config import HydraConfig

    own = ("recording=", "one=", "two=", "models=", "seeds=", "jobs=", "bench.")
    return [word for word in HydraConfig.get().overrides.task if not word.startswith(own)]


def _recordings(config: DictConfig) -> dict[str, Path | None]:
    given = {role: None if config[role] is None else Path(config[role]) for role in ("recording", "one", "two")}
    if given["recording"] is not None:
        return given
    if given["one"] is not None or given["two"] is not None:
        raise UserError("one= and two= are tests of a training recording: give recording=FILE too")
    return _bench_recordings(config)


def _bench_recordings(config: DictConfig) -> dict[str, Path | None]:
    """The recordings of the simulated bench, made where they are missing."""
    from ertskin.cluster import LocalCluster
    from ertskin.progress import counting

    folder, effects, seed = Path(config.bench.folder), dict(config.bench.effects), int(config.bench.seed)
    folder.mkdir(parents=True, exist_ok=True)
    skin = request_key({"effects": effects, "seed": seed})
    bench = SimulatedBench(tuple(folder / f"{skin}_{kind}.h5" for kind in KINDS.values()), effects, seed)
    missing = [number for number, path in enumerate(bench.paths) if not path.is_file()]
    if missing:
        print(f"recording on a simulated bench, with {', '.join(effects) or 'nothing'} hidden in it", flush=True)
        with counting("recordings") as progress:
            progress(0, len(missing))
            for done, _ in enumerate(LocalCluster(int(config.jobs)).spread(bench, missing), 1):
                progress(done, len(missing))
    return dict(zip(KINDS, bench.paths, strict=True))


@dataclass(frozen=True)
class SimulatedBench:
    """Writes recording ``number`` of one simulated skin; travels to worker processes."""

    paths: tuple[Path, ...]
    effects: dict[str, float]
    seed: int

    def __call__(self, number: int) -> None:
        from hardware.virtual.bench import write_bench

        write_bench(self.paths[number], tuple(KINDS.values())[number], self.effects, self.seed)


def _accepted(verb: str, settings: list[str]) -> list[str]:
    """The settings whose group or section the verb has."""
    from omegaconf import OmegaConf

    from ertskin.configuration import config_dir

    loaded = OmegaConf.load(config_dir() / f"{verb}.yaml")
    entries = [entry for entry in loaded.defaults if hasattr(entry, "items")]
    known = {str(group) for entry in entries for group in entry} | {str(key) for key in loaded}
    return [setting for setting in settings if setting.split("=")[0].split(".")[0] in known]


def _step(words: list[str]) -> None:
    """Run one command of ours and let it speak; ``JobFailed`` if it failed, ``KeyboardInterrupt`` if it was stopped."""
    print(f"\n$ ertskin {shlex.join(words)}", flush=True)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    status = subprocess.run([sys.executable, "-m", "ertskin.cli", *words], env=environment, check=False).returncode
    if status in (130, -2):
        raise KeyboardInterrupt
    if status:
        raise JobFailed(f"the step above ended with status {status}: ertskin {shlex.join(words)}")
