"""Make a recording of somebody else's file: NPZ, MAT, CSV or an EIDORS structure.

``--template source=FILE`` writes import.yaml, a mapping to begin with that says what FILE holds;
``source=FILE mapping=import.yaml out=mine.h5`` follows it, and says what the recording holds as ``doctor`` does.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ertskin.errors import UserError

if TYPE_CHECKING:
    from omegaconf import DictConfig


def reworded(arguments: list[str]) -> list[str]:
    """``--template`` and ``--template=FILE`` as ``template=FILE``."""
    words = []
    for word in arguments:
        option, _, name = word.partition("=")
        words.append(f"template={name or 'import.yaml'}" if option == "--template" else word)
    return words


def run(config: DictConfig) -> None:
    """Write the template, or the recording."""
    from ertskin.importing.template import write_template

    source = None if config.source is None else Path(config.source)
    if config.template is not None:
        write_template(Path(config.template), source)
        print(f"{config.template}: put in which entry is which, then")
        print(f"ertskin import source={config.source or 'FILE'} mapping={config.template}")
    elif source is None:
        raise UserError("'source' must be given: source=FILE (a mapping to begin with: ertskin import --template)")
    else:
        import_file(source, Path(config.mapping), Path(config.out) if config.out else source.with_suffix(".h5"))


def import_file(source: Path, mapping: Path, out: Path) -> None:
    """Write the recording aside, look at it as ``doctor`` does, and put it in place; never over one that is there."""
    from rich.console import Console

    from ertskin.commands.doctor import examine_recording
    from ertskin.hardware.recording import RecordingError, write_recording
    from ertskin.importing.mapping import recording_of

    if out.exists():
        raise UserError(f"{out}: is there already and was left alone; name another: out=OTHER.h5")
    recording = recording_of(source, mapping)
    aside = out.with_name(f".{out.stem}.{os.getpid()}.h5")
    try:
        write_recording(aside, recording)
        examine_recording(aside, Console(), called=out)
        os.replace(aside, out)
    except RecordingError as error:
        raise UserError(f"{mapping} makes no sound recording of {source}: {error}".replace(f"{aside}: ", "")) from None
    finally:
        aside.unlink(missing_ok=True)
    print(f"recording: {out}\nertskin calibrate recording={out}")
