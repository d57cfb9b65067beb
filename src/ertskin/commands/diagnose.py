"""Say what physics a recording shows that the simulator leaves out.

``recording=FILE out=DIR`` writes diagnosis.json, report.html with figures, and the effects found as a choice for
synthesize and train: effects=NAME, NAME being the recording's. With ``retrain=true`` and test recordings ``one=FILE``
``two=FILE`` it trains with and without what was found and says what that does to the metrics.
``criteria.NAME=NUMBER`` decides by another number, ``criteria=CHOICE`` by a file of them.
Many at once, each on its own worker of the cluster:
recording=[A.h5,B.h5] or recording='FOLDER/*.h5'; every one then has its own folder below out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig
    from rich.console import Console

    from ertskin.diagnosis.contract.claims import Diagnosis
    from ertskin.diagnosis.criteria import Criteria
    from ertskin.diagnosis.output.retraining import Retraining
    from ertskin.hardware.recording import Recording

EFFECTS = Path("runs/conf")
CALIBRATIONS = Path("runs/calibrate")
Report = Callable[[float | None, str], None]


def run(config: DictConfig) -> None:
    """Diagnose ``config.recording``, one or many, and write what was found into ``config.out``."""
    from rich.console import Console

    from ertskin.diagnosis.criteria import Criteria
    from ertskin.settings import checked

    criteria = checked(Criteria, config.criteria, "criteria")
    sources = _recordings(config.recording)
    if len(sources) == 1:
        _diagnose_one(config, sources[0], criteria, Console())
    else:
        _diagnose_many(config, sources, criteria, Console())


@dataclass(frozen=True)
class Diagnoses:
    """Diagnoses recording ``number`` of ``sources`` into its folder; travels to workers that see the same files."""

    sources: tuple[Path, ...]
    folders: tuple[Path, ...]
    effects: Path
    calibrations: Path
    resolution: str
    criteria: Criteria

    def __call__(self, number: int) -> Diagnosis | str:
        """The diagnosis, or the line that says why there is none: one bad file must not end the others."""
        from ertskin.errors import JobFailed, UserError
        from ertskin.hardware.recording import RecordingError

        try:
            return self.diagnosed(number, lambda share, text: None)[0]
        except (UserError, JobFailed, RecordingError) as error:
            return " ".join(str(error).split())

    def diagnosed(self, number: int, report: Report) -> tuple[Diagnosis, list[Path]]:
        """The diagnosis and the files written; ``report(share, text)`` follows it."""
        from ertskin.hardware.recording import read_recording

        source, out = self.sources[number], self.folders[number]
        recording = read_recording(source)  # Refused before what follows loads for seconds.

        from ertskin.data.shards import file_sha256
        from ertskin.diagnosis.any_recording import diagnose_any
        from ertskin.diagnosis.output.diagnosis_file import write_diagnosis, write_effects
        from ertskin.diagnosis.output.figures import write_figures
        from ertskin.diagnosis.output.joint_calibration import write_joint_calibration
        from ertskin.diagnosis.output.names import config_name
        from ertskin.diagnosis.output.report import write_report
        from ertskin.report.provenance import provenance

        name = config_name(source)
        findings = diagnose_any(recording, source.name, report, self.resolution, criteria=self.criteria)
        report(0.95, "writing the report")
        effects = findings.diagnosis.effects
        written = [write_effects(folder, name, effects, source.name) for folder in (out, self.effects)]
        joint = write_joint_calibration(self.calibrations, source, findings)
        written += [] if joint is None else [joint]
        drawn = write_figures(out, findings)
        commands = next_commands(source, name, out, findings.diagnosis, _contacts(recording))
        about = {
            "recording_sha256": file_sha256(source),
            "criteria": asdict(self.criteria),
            "figures": [one.as_builtins() for one in drawn],
        }
        diagnosis = replace(findings.diagnosis, extra={**findings.diagnosis.extra, **about})
        made = write_report(out, findings, drawn, commands, provenance(source, self.resolution))
        written += [made, write_diagnosis(out, diagnosis)]
        return diagnosis, written


def _contacts(recording: Recording) -> int:
    """How many contacts a frame has room for."""
    return 0 if recording.frames is None else recording.frames.history.contact_m.shape[1]


def next_commands(source: Path, name: str, out: Path, diagnosis: Diagnosis, contacts: int) -> tuple[str, ...]:
    """What a person would type next: train with the effects named, or see what the recording allows, and add the press
    that would settle what is in doubt to a recording of one contact."""
    press = f"ertskin record rig=NAME sensor=NAME plan={out / 'diagnosis.json'} recording={source}"
    settling = () if diagnosis.next_press is None or contacts != 1 else (press,)
    if not diagnosis.effects:
        return (f"ertskin doctor recording={source}", f"ertskin train recording={source} model=reciprocal", *settling)
    return (
        f"ertskin train recording={source} model=reciprocal effects={name}",
        f"ertskin evaluate recording={source} effects={name} one=TEST.h5",
        f"ertskin diagnose recording={source} retrain=true one=TEST.h5",
        *settling,
    )


def _diagnose_one(config: DictConfig, source: Path, criteria: Criteria, console: Console) -> None:
    from ertskin.diagnosis.output.names import config_name
    from ertskin.diagnosis.output.progress import progress_bar

    retraining = _retraining(config)
    out = Path(config.out) if config.out else Path("runs/diagnose") / config_name(source)
    with progress_bar(console) as report:
        pieces = Diagnoses((source,), (out,), EFFECTS, CALIBRATIONS, config.physics.resolution, criteria)
        diagnosis, written = pieces.diagnosed(0, report)
    from ertskin.diagnosis.output.summary import print_summary

    print_summary(console, diagnosis)
    for path in written:
        console.print(str(path), soft_wrap=True, highlight=False)
    if retraining is not None:
        _retrain(retraining, diagnosis, source, out, console)


def _retraining(config: DictConfig) -> Retraining | None:
    """What is asked for, checked before the diagnosis takes its minutes."""
    if not config.retrain:
        return None
    from ertskin.diagnosis.output.retraining import Retraining
    from ertskin.hardware.recording import read_recording

    one, two = (None if config[role] is None else Path(config[role]) for role in ("one", "two"))
    for test in (one, two):
        if test is not None:
            read_recording(test)
    return Retraining(one, two, tuple(config.models), tuple(config.seeds), tuple(config.settings))


def _retrain(retraining: Retraining, diagnosis: Diagnosis, source: Path, out: Path, console: Console) -> None:
    from ertskin.diagnosis.output.diagnosis_file import write_diagnosis
    from ertskin.diagnosis.output.names import config_name
    from ertskin.diagnosis.output.summary import print_retrained

    if not diagnosis.effects:
        console.print("no effect is handed on: there is nothing to retrain with")
        return
    retrained = retraining.compared(source, config_name(source), out / "retrained")
    print_retrained(console, retrained)
    write_diagnosis(out, replace(diagnosis, extra={**diagnosis.extra, "retrained": retrained}))
    for name in retrained:
        report = out / "retrained" / name / "evaluate" / "report.html"
        console.print(f"report {name} the effects: {report}", soft_wrap=True, highlight=False)


def _diagnose_many(config: DictConfig, sources: tuple[Path, ...], criteria: Criteria, console: Console) -> None:
    import hydra

    from ertskin.diagnosis.output.names import config_name
    from ertskin.diagnosis.output.summary import print_summary
    from ertskin.errors import JobFailed, UserError
    from ertskin.progress import counting

    if config.retrain:
        raise UserError("retrain=true takes one recording, not many")
    names = [config_name(source) for source in sources]
    if len(set(names)) < len(names):
        raise UserError(f"recordings with the same name would write into the same folder: {', '.join(sorted(names))}")
    out = Path(config.out or "runs/diagnose").resolve()
    # A worker may run in another directory.
    pieces = Diagnoses(
        tuple(source.resolve() for source in sources),
        tuple(out / name for name in names),
        EFFECTS.resolve(),
        CALIBRATIONS.resolve(),
        config.physics.resolution,
        criteria,
    )
    failed = 0
    with counting("diagnosing") as progress:
        spread = hydra.utils.instantiate(config.cluster).spread(pieces, range(len(sources)))
        for done, (number, diagnosis) in enumerate(spread, 1):
            console.print(f"\n{sources[number]}", soft_wrap=True, highlight=False)
            if isinstance(diagnosis, str):
                failed += 1
                console.print(f"FAILED: {diagnosis}", soft_wrap=True, highlight=False)
            else:
                print_summary(console, diagnosis)
                console.print(str(pieces.folders[number]), soft_wrap=True, highlight=False)
            progress(done, len(sources))
    if failed:
        raise JobFailed(f"{failed} of {len(sources)} recordings could not be diagnosed")


def _recordings(given: object) -> tuple[Path, ...]:
    """Files of a path, a list of paths, or a pattern with ``*``; ``UserError`` where a pattern matches none."""
    from glob import glob

    from ertskin.errors import UserError

    words = [given] if isinstance(given, str) else list(given)  # type: ignore[call-overload]
    found = [path for word in words for path in (sorted(glob(word)) if "*" in word else [word])]
    if not found:
        raise UserError(f"no recording matches {', '.join(words)}")
    return tuple(Path(path) for path in found)
