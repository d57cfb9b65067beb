"""Velostat under a load cell: fit ten presses, predict the other six and the other forces.

    python experiments/real/velostat/run.py DATA [OUT]

DATA holds real/velostat_5n.h5, _10n.h5 and _20n.h5; results and figures go to OUT, this folder by default.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from figures import place_figure, within_figure
from film import FITTED, FORCES_N, PRESSES, Film, Rows
from forms import AGES, CREEPS, LOG_CREEP, PLAYS, TUNNEL, Fitted, Form, FreeLaw, Preisach
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ertskin.diagnosis.specimen.diagnosis import diagnose_specimen
from ertskin.files import write_whole
from ertskin.hardware.recording import read_recording
from ertskin.report.figures.image import save_png

Array = NDArray[np.float64]
NOWHERE = np.zeros(PRESSES)
ALIKE = {
    "static, any law": FreeLaw(),
    "static, polynomial of fifth order": FreeLaw(5, logarithmic=False),
    "static, tunnelling": Form(TUNNEL),
    "static, contacts": Form(),
    "contacts, hysteresis": Form(memory=(PLAYS,)),
    "contacts, creep": Form(memory=(CREEPS,)),
    "contacts, hysteresis and creep": Form(memory=(PLAYS, CREEPS)),
    "contacts, creep even in log time": Form(memory=(LOG_CREEP,)),
    "contacts that age": Form(memory=(AGES,)),
    "Preisach, all weights free": Preisach(),
    "any law, any fading memory": FreeLaw(ladder=True),
}
"""Forms for which all presses are alike."""
SENSITIVITY = "static, contacts, each press its sensitivity"
APART = {
    "static, contacts, each press its factor": Form(places="resistance"),
    SENSITIVITY: Form(places="sensitivity"),
    "the same, hysteresis": Form(memory=(PLAYS,), places="sensitivity"),
    "the same, creep": Form(memory=(CREEPS,), places="sensitivity"),
    "the same, hysteresis and creep": Form(memory=(PLAYS, CREEPS), places="sensitivity"),
    "the same, creep even in log time": Form(memory=(LOG_CREEP,), places="sensitivity"),
    "the same, contacts that age": Form(memory=(AGES,), places="sensitivity"),
}
"""Forms in which what the film is worth under a press has a number of its own."""


def main() -> None:
    """Every form on every recording, what presses share across forces, and what the diagnosis says."""
    data = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    films = [Film.read(data, force_n) for force_n in FORCES_N]
    rows = {name: compared(form, films) for name, form in (ALIKE | APART).items()}
    models = [APART[SENSITIVITY].fit([film], [everything(film)]) for film in films]
    results = {
        "forms": rows,
        "presses": agreement(films, models),
        "diagnosis": {film.force_n: verdict(data, film.force_n) for film in films},
    }
    write_whole(out / "results.json", json.dumps(results, indent=1) + "\n")
    save_png(place_figure(films, models), out / "places.png")
    save_png(within_figure(films, models), out / "within.png")
    print(table(rows))
    print(json.dumps(results["presses"], indent=1))


def everything(film: Film) -> Rows:
    """(N,) all readings."""
    return np.ones(len(film.press), dtype=bool)


def compared(form: Any, films: Sequence[Film]) -> dict[str, list[float]]:
    """Relative rms errors under load: of the ten presses fitted, of the other six, and at the other forces, where the
    first ten presses are those fitted and the last six were never seen."""
    row: dict[str, list[float]] = {key: [] for key in ("fitted", "last_six", "own_rise", "same_presses", "new_presses")}
    row["at_rest"] = []
    for film in films:
        others = [other for other in films if other is not film]
        model = form.fit([film], [film.early])
        seen = model.log_sensitivity if isinstance(model, Fitted) else NOWHERE
        late = ~film.early
        known = from_other_forces(form, model, others) if isinstance(model, Fitted) and form.places else NOWHERE
        row["fitted"].append(rms(model, film, seen, film.early & film.loaded))
        row["last_six"].append(rms(model, film, known, late & film.loaded))
        row["at_rest"].append(rms(model, film, known, late & ~film.loaded))
        if isinstance(model, Fitted) and form.places:
            risen = from_own_rise(model, film)
            row["own_rise"].append(rms(model, film, risen, late & film.loaded & ~film.rising))
        for other in others:
            row["same_presses"].append(rms(model, other, seen, other.early & other.loaded))
            row["new_presses"].append(rms(model, other, seen, ~other.early & other.loaded))
    return row


def rms(model: Any, film: Film, log_sensitivity: Array, rows: Rows) -> float:
    """Relative rms error of a prediction over the readings ``rows`` (N,)."""
    return float(np.sqrt((((model(film, log_sensitivity) - film.log_resistance)[rows]) ** 2).mean()))


def from_other_forces(form: Form, model: Fitted, others: Sequence[Film]) -> Array:
    """(16,) log sensitivities of all presses by the other two recordings, brought to the mean of the ten fitted here.

    The form's static law finds them: what is remembered within a press changes them little.
    """
    elsewhere = Form(form.law, (), form.places).fit(others, [everything(other) for other in others]).log_sensitivity
    shift = model.log_sensitivity[:FITTED].mean() - elsewhere[:FITTED].mean()
    return np.asarray(elsewhere + shift)


def from_own_rise(model: Fitted, film: Film) -> Array:
    """(16,) log sensitivities, each found in its press's own rise alone, which is no part of what is predicted then."""
    found = np.zeros(PRESSES)
    for press in range(PRESSES):
        rows = (film.press == press) & film.rising & film.loaded

        def cost(value: float, press: int = press, rows: Rows = rows) -> float:
            trial = found.copy()
            trial[press] = value
            return float(np.abs((model(film, trial) - film.log_resistance)[rows]).sum())

        found[press] = minimize_scalar(cost, bounds=(-3, 3), method="bounded").x
    return found


def agreement(films: Sequence[Film], models: Sequence[Fitted]) -> dict[str, Any]:
    """How alike the presses' sensitivities are at the three forces, and how much of the error is theirs."""
    log = np.array([model.log_sensitivity for model in models])
    between = []
    for film in films:
        wrong = FreeLaw().fit([film], [everything(film)])(film, NOWHERE) - film.log_resistance
        mean = np.array([wrong[film.loaded & (film.press == k)].mean() for k in range(PRESSES)])
        between.append(float((mean[film.press[film.loaded]] ** 2).mean() / (wrong[film.loaded] ** 2).mean()))
    return {
        "log_sensitivity": log.round(3).tolist(),
        "correlation": np.corrcoef(log).round(3).tolist(),
        "spread": [float(one.std()) for one in log],
        "differs_between_forces": float(
            (log - log.mean(axis=0) - (log - log.mean(axis=0)).mean(axis=1)[:, None]).std()
        ),
        "between_presses_share_of_static_error": between,
        "contact_power": [float(model.x[2]) for model in models],
        "drift_per_press": [float(np.polyfit(np.arange(PRESSES), one, 1)[0]) for one in log],
    }


def verdict(data: Path, force_n: int) -> dict[str, Any]:
    """What ``ertskin diagnose`` says of a recording."""
    name = f"velostat_{force_n}n.h5"
    specimen = read_recording(data / "real" / name).specimen
    assert specimen is not None
    said = diagnose_specimen(specimen, name).diagnosis.as_builtins()
    keys = ("verdict", "reason", "specimen_held_out", "presses", "effects")
    return {key: said.get(key) for key in keys} | {"depends_on": said["where"]["depends_on"]}


def table(rows: dict[str, dict[str, list[float]]]) -> str:
    """Errors in percent as a Markdown table."""
    head = ("fitted on the first ten presses", "these", *(f"last six, {f} N" for f in FORCES_N), "at rest")
    lines = ["| " + " | ".join((*head, "other forces, same presses", "other forces, other presses")) + " |"]
    lines.append("| --- " * 8 + "|")
    for name, row in rows.items():
        medians = [np.median(row[key]) for key in ("at_rest", "same_presses", "new_presses")]
        values = [np.median(row["fitted"]), *row["last_six"], *medians]
        lines.append(f"| {name} | " + " | ".join(f"{100 * v:.0f}" for v in values) + " |")
        if row["own_rise"]:
            cells = ["", *(f"{100 * v:.0f}" for v in row["own_rise"]), "", "", ""]
            lines.append("| *sensitivity from the press's own rise* | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
