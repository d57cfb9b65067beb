"""The main job: from a recording to what its simulator lacked, calibrated networks without and with it, and a report.

With ``recording=FILE`` and its tests ``one=FILE two=FILE anywhere=FILE``, or without any recorded on ``rig``, the
virtual bench unless another is named. Every step is a command a person could type, and prints as such; what is done
already is not done again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ertskin.cores import given_cores
from ertskin.data.shards import file_sha256, request_key
from ertskin.data.synthesis import planned
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.errors import UserError
from ertskin.settings import checked, whole_number
from ertskin.steps import meanwhile, run_step
from ertskin.training.settings import trainer_settings

if TYPE_CHECKING:
    from omegaconf import DictConfig

PLANS = {"recording": "quick", "one": "one_point_test", "two": "two_point_test", "anywhere": "anywhere_test"}
"""Role of a recording in the job, and the plan the rig carries out for it."""
ROLES = ("one", "two", "anywhere")
"""Tests of a training recording."""
OWN = (
    *("recording", *ROLES, "models", "seeds", "between", "with_effects", "jobs", "recordings", "diagnose"),
    *("yardsticks", "yardstick_seeds"),
)
"""Settings of this command itself; what else is typed is handed on."""


@dataclass(frozen=True)
class Found:
    """Folder of a recording's diagnosis, and the choice of effects it wrote; None where there is none."""

    folder: Path | None = None
    effects: str | None = None


def run(config: DictConfig) -> None:
    """Record (unless a recording is given), calibrate, diagnose, train without and with what was found, evaluate."""
    begun = time.monotonic()
    for seed in config.seeds:
        trainer_settings(config.trainer, seed)
    planned(config.data.plan)
    criteria = checked(Criteria, config.criteria, "criteria")
    jobs = whole_number(config.jobs, "jobs", least=1)
    _known_networks(config)
    files = _recordings(config)
    source = files["recording"]
    assert source is not None
    recording = f"recording={source}"
    settings = _handed_on()
    for role in ("recording", *ROLES):
        if files.get(role) is not None:
            run_step(["doctor", f"recording={files[role]}"])
    run_step(["calibrate", recording, *_accepted("calibrate", settings)])
    found = _trained(config, source, criteria, settings, jobs)
    tests = [f"{role}={files[role]}" for role in ROLES if files.get(role) is not None]
    if tests:
        story = [] if found.folder is None else [f"diagnosis={found.folder}"]
        if config.recording is None and config.rig.get("sealed"):
            story.append(f"sealed={config.rig.sealed}")
        _evaluate(config, recording, [*tests, *story, *_simulated_with(found.effects)], settings)
    else:
        print("no test recording given (one=FILE two=FILE anywhere=FILE): nothing to evaluate on")
    print(f"\ndone in {time.monotonic() - begun:.0f} s; compare the runs with: ertskin dashboard")


def _known_networks(config: DictConfig) -> None:
    """Raises ``UserError`` where the networks asked for are no list of choices of ``model``, or effects are asked for
    in one that isn't trained."""
    from omegaconf import ListConfig

    from ertskin.configuration import config_dir

    known = sorted(path.stem for path in (config_dir() / "model").glob("*.yaml"))
    asked = {"models": config.models, "between.models": config.between.models, "with_effects": config.with_effects}
    for setting, names in asked.items():
        if not isinstance(names, ListConfig):
            raise UserError(f"{setting} must be a list, as [contacts,paper] or [], not {names!r}")
        if wrong := [str(name) for name in names if name not in known]:
            raise UserError(f"{setting}: no network {wrong[0]!r}; there are {', '.join(known)}")
    trained = (*config.models, *config.between.models)
    if untrained := [name for name in config.with_effects if name not in trained]:
        raise UserError(f"with_effects: {untrained[0]} isn't trained: name it in models= or between.models= too")


def _trained(config: DictConfig, source: Path, criteria: Criteria, settings: list[str], jobs: int) -> Found:
    """What the recording's diagnosis says, once the networks are trained without it and with it.

    Where there is room for two jobs those without it are trained while the recording is diagnosed; once they are, what
    is left has all cores.
    """
    choose = partial(_training_steps, config, f"recording={source}", settings)
    if not config.diagnose or any(word.startswith("effects=") for word in settings):
        for step in choose([], jobs):
            run_step(step)
        return Found()
    diagnosing = ["diagnose", f"recording={source}", *_accepted("diagnose", settings)]
    found = _diagnosis(source, criteria)
    if found.folder is None and jobs > 1 and given_cores() > 1:
        cores = given_cores() // 2
        with meanwhile(choose(["none"], jobs // 2), Path("runs/run") / f"{source.stem}_none.log", cores) as others:
            run_step(diagnosing, cores)
            found = _diagnosis(source, criteria)
            if found.effects:
                each = (choose([found.effects], some) for some in (jobs // 2, jobs))
                for shared, alone in zip(*each, strict=True):
                    run_step(*((shared, cores) if others.is_alive() else (alone,)))
        return found
    if found.folder is None:
        run_step(diagnosing)
        found = _diagnosis(source, criteria)
    for step in choose(["none", found.effects] if found.effects else ["none"], jobs):
        run_step(step)
    return found


def _diagnosis(source: Path, criteria: Criteria) -> Found:
    """What has been found in the recording; nothing yet, unless of the same bytes and by the same criteria."""
    from ertskin.diagnosis.output.names import config_name

    name = config_name(source)
    folder = Path("runs/diagnose") / name
    path = folder / "diagnosis.json"
    if not path.is_file():
        return Found()
    earlier = _read(path)
    same = earlier.get("criteria", asdict(DEFAULT)) == asdict(criteria)
    if not same or earlier.get("recording_sha256") != file_sha256(source):
        return Found()
    return Found(folder, name if earlier.get("handed_on", bool(earlier["effects"])) else None)


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8")))


def _training_steps(
    config: DictConfig, recording: str, settings: list[str], effects: list[str], jobs: int
) -> list[list[str]]:
    """Commands that train the networks of contacts anywhere on their trials and those of the taxels on theirs, with
    each choice of ``effects``; as configured where there is none."""
    accepted = _accepted("train", settings)
    # They learn from contacts anywhere, whatever the others learn from.
    own = [word for word in accepted if not word.startswith(("data", "trainer"))]
    own += config.between.settings
    steps = []
    for models, choices in _choices_of(config.between.models, effects, config.with_effects):
        steps.append(["train", "-m", recording, *_swept(config, models, choices), *own, *_launcher(jobs)])
    for models, choices in _choices_of(config.models, effects, config.with_effects):
        for choice in choices or ["none"]:
            chosen = _simulated_with(None if choice == "none" else choice)
            steps.append(["synthesize", recording, *chosen, *_accepted("synthesize", settings)])
        steps.append(["train", "-m", recording, *_swept(config, models, choices), *accepted, *_launcher(jobs)])
    return steps


def _choices_of(
    models: Sequence[str], effects: list[str], with_effects: Sequence[str]
) -> list[tuple[list[str], list[str]]]:
    """Models that are trained with the same choices of ``effects``, and these: what was found is for those that
    ``with_effects`` names."""
    asked: dict[tuple[str, ...], list[str]] = {}
    for model in models:
        choices = tuple(choice for choice in effects if choice == "none" or model in with_effects)
        if choices or not effects:
            asked.setdefault(choices, []).append(model)
    return [(together, list(choices)) for choices, together in asked.items()]


def _swept(config: DictConfig, models: list[str], choices: list[str]) -> list[str]:
    """What a multirun of these models goes through."""
    seeds = f"seed={','.join(map(str, config.seeds))}"
    return [f"model={','.join(models)}", seeds, *([f"effects={','.join(choices)}"] if choices else [])]


def _evaluate(config: DictConfig, recording: str, given: list[str], settings: list[str]) -> None:
    yardsticks = [f"yardsticks=[{','.join(config.yardsticks)}]", f"yardstick_seeds={config.yardstick_seeds}"]
    run_step(["evaluate", recording, *given, *yardsticks, *_accepted("evaluate", settings)])


def _simulated_with(effects: str | None) -> list[str]:
    return [f"effects={effects}"] if effects else []


def _handed_on() -> list[str]:
    """What was typed that isn't a setting of this command itself."""
    from hydra.core.hydra_config import HydraConfig

    words = HydraConfig.get().overrides.task
    return [word for word in words if word.lstrip("+~").split("=")[0].split(".")[0] not in OWN]


def _recordings(config: DictConfig) -> dict[str, Path | None]:
    given = {role: None if config[role] is None else Path(config[role]) for role in ("recording", *ROLES)}
    if given["recording"] is not None:
        return given
    if any(given[role] is not None for role in ROLES):
        raise UserError("one=, two= and anywhere= are tests of a training recording: give recording=FILE too")
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
