"""The main job: from a recording to calibrated networks, their comparison and a report.

With ``recording=FILE`` and its tests ``one=FILE two=FILE``, or without any recorded on ``rig``, the virtual bench
unless another is named. Every step is a command a person could type, and prints as such; what is done already is not
done again.
"""

from __future__ import annotations

import time
from pathlib import Path

from omegaconf import DictConfig

from ertskin.data.shards import request_key
from ertskin.errors import UserError
from ertskin.steps import run_step

PLANS = {"recording": "quick", "one": "one_point_test", "two": "two_point_test"}
"""Role of a recording in the job, and the plan the rig carries out for it."""


def run(config: DictConfig) -> None:
    """Record (unless a recording is given), calibrate, synthesize, train, evaluate."""
    begun = time.monotonic()
    files = _recordings(config)
    recording = f"recording={files['recording']}"
    tests = [f"{role}={files[role]}" for role in ("one", "two") if files[role] is not None]
    settings = _handed_on()
    run_step(["doctor", recording])
    run_step(["calibrate", recording, *_accepted("calibrate", settings)])
    run_step(["synthesize", recording, *_accepted("synthesize", settings)])
    sweep = [f"model={','.join(config.models)}", f"seed={','.join(map(str, config.seeds))}"]
    run_step(["train", "-m", recording, *sweep, *_accepted("train", settings), *_launcher(int(config.jobs))])
    if tests:
        run_step(["evaluate", recording, *tests, *_accepted("evaluate", settings)])
    else:
        print("no test recording given (one=FILE two=FILE): nothing to evaluate on")
    print(f"\ndone in {time.monotonic() - begun:.0f} s; compare the runs with: ertskin dashboard")


def _handed_on() -> list[str]:
    """What was typed that isn't a setting of this command itself."""
    from hydra.core.hydra_config import HydraConfig

    own = ("recording=", "one=", "two=", "models=", "seeds=", "jobs=", "recordings=")
    return [word for word in HydraConfig.get().overrides.task if not word.startswith(own)]


def _recordings(config: DictConfig) -> dict[str, Path | None]:
    given = {role: None if config[role] is None else Path(config[role]) for role in ("recording", "one", "two")}
    if given["recording"] is not None:
        return given
    if given["one"] is not None or given["two"] is not None:
        raise UserError("one= and two= are tests of a training recording: give recording=FILE too")
    return _recorded(config)


def _recorded(config: DictConfig) -> dict[str, Path | None]:
    """Recordings of the rig, made where they are missing, on a virtual one side by side."""
    from omegaconf import OmegaConf

    rig = request_key({name: OmegaConf.to_container(config[name], resolve=True) for name in ("rig", "sensor")})
    files = {role: Path(config.recordings) / f"{rig}_{plan}.h5" for role, plan in PLANS.items()}
    missing = [PLANS[role] for role, path in files.items() if not path.is_file()]
    if missing:
        into = f"recording={config.recordings}/{rig}_${{hydra:runtime.choices.plan}}.h5"
        side_by_side = _launcher(int(config.jobs)) if config.rig.get("virtual") else []
        accepted = _accepted("record", _handed_on())
        run_step(["record", "-m", f"plan={','.join(missing)}", into, *accepted, *side_by_side])
    return dict(files)


def _launcher(jobs: int) -> list[str]:
    return ["hydra/launcher=joblib", f"hydra.launcher.n_jobs={jobs}"] if jobs > 1 else []


def _accepted(verb: str, settings: list[str]) -> list[str]:
    """The settings whose group or section the verb has."""
    from omegaconf import OmegaConf

    from ertskin.configuration import config_dir

    loaded = OmegaConf.load(config_dir() / f"{verb}.yaml")
    entries = [entry for entry in loaded.defaults if hasattr(entry, "items")]
    known = {str(group) for entry in entries for group in entry} | {str(key) for key in loaded}
    return [setting for setting in settings if setting.split("=")[0].lstrip("+~").split(".")[0] in known]
