"""Fit the simulator's numbers to a recording.

Stiffness of the indenter's support, moduli, piezoresistive law and one contact resistance per electrode, as far as the
recording holds them; then the model's error on its presses, with the figures of the paper.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ertskin.hardware.recording import read_recording

if TYPE_CHECKING:
    from omegaconf import DictConfig


def run(config: DictConfig) -> None:
    """Write calibration.yaml and the figures into ``config.out`` and print what was found."""
    source = Path(config.recording)
    recording = read_recording(source)  # Refused before what follows loads for seconds.

    from rich.console import Console

    from ertskin.calibration.drawing import FIGURES, calibration_figures
    from ertskin.calibration.fit import fit_recording
    from ertskin.calibration.model_error import model_error
    from ertskin.calibration.store import save_calibration
    from ertskin.calibration.summary import print_summary
    from ertskin.data.skin_forward import SkinForward
    from ertskin.data.sources import CALIBRATION, calibration_folder
    from ertskin.data.touches import touches_of
    from ertskin.report.calibration_page import write_calibration_page
    from ertskin.report.figures.image import save_png
    from ertskin.report.provenance import provenance

    console = Console()
    out = Path(config.out) if config.out else calibration_folder(Path(config.calibration.folder), source)
    with console.status("calibrating") as status:

        def say(line: str) -> None:
            status.update(f"calibrating: {line}")

        calibration, fits = fit_recording(recording, source.name, config.method, config.physics.resolution, say)
        save_calibration(out / CALIBRATION, calibration)
        error = None
        pressed = recording.frames is not None and bool(recording.frames.history.touched.any())
        layered = calibration.sensor is not None and bool(calibration.sensor.layers)
        if pressed and layered and recording.protocol is not None and calibration.law is not None:
            say("comparing model and presses")
            forward = SkinForward(calibration, recording.protocol, {}, config.physics.resolution)
            error = model_error(forward, touches_of(recording))
        say("drawing")
        drawn = {}
        for name, figure in calibration_figures(recording, calibration, fits, error, config.physics.resolution):
            drawn[name] = save_png(figure, out / f"{name}.png")
        page = write_calibration_page(
            out, source, recording, calibration, provenance(source, config.physics.resolution)
        )
    print_summary(console, calibration, fits, error)
    for name, path in drawn.items():
        console.print(f"{path}  [dim]{FIGURES[name]}[/dim]", soft_wrap=True, highlight=False)
    console.print(f"calibration: {out / CALIBRATION}", soft_wrap=True, highlight=False)
    console.print(f"report: {page}", soft_wrap=True, highlight=False)
