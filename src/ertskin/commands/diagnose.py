"""Say what physics a recording shows that the simulator leaves out.

``recording=FILE out=DIR`` writes diagnosis.json, report.html with figures, and the effects found as a choice for
synthesize and train: effects=NAME, NAME being the recording's.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

EFFECTS = Path("runs/conf")


def run(config: DictConfig) -> None:
    """Diagnose ``config.recording`` and write what was found into ``config.out``."""
    from rich.console import Console

    from ertskin.diagnosis.any_recording import diagnose_any
    from ertskin.diagnosis.progress import progress_bar
    from ertskin.diagnosis.report import write_report
    from ertskin.diagnosis.summary import print_summary
    from ertskin.diagnosis.written import config_name, write_diagnosis, write_effects
    from hardware.recording import read_recording

    console, source = Console(), Path(config.recording)
    recording = read_recording(source)
    name = config_name(source)
    out = Path(config.out) if config.out else Path("runs/diagnose") / name
    with progress_bar(console) as report:
        findings = diagnose_any(recording, source.name, report, config.physics.resolution)
        report(0.95, "writing the report")
        effects = tuple(claim.effect for claim in findings.diagnosis.claims)
        written = [write_effects(out, name, effects, source.name), write_effects(EFFECTS, name, effects, source.name)]
        written.append(write_report(out, findings))
        written.append(write_diagnosis(out, findings.diagnosis))
    print_summary(console, findings.diagnosis)
    for path in written:
        console.print(str(path), soft_wrap=True, highlight=False)
