"""Where was the e-skin touched? An ensemble of networks against the best kernel ridge, on touches recorded later.

    python experiments/real/eskin/run.py DATA [OUT]

DATA holds real/eskin_radial.h5 and real/eskin_fullCB.h5; results and figures go to OUT, this folder by default.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import kernel_ridge
import location_network
import numpy as np
import torch
from figures import error_distribution, error_map
from sklearn.linear_model import RidgeCV
from touches import SkinTouches, errors_mm, hit_rate

from ertskin.files import write_whole
from ertskin.report.figures.image import png

SKINS = ("radial", "fullCB")
SEEDS = (0, 1, 2)
BASE = location_network.Settings()
TRIED = (
    BASE,
    replace(BASE, scale=300.0),
    replace(BASE, scale=3000.0),
    replace(BASE, dropout=0.05),
    replace(BASE, dropout=0.2),
)


def main() -> None:
    """Both skins: tune on the early touches, then look once at the last 500."""
    data = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    torch.set_num_threads(1)
    results = {name: study(SkinTouches.read(data / "real" / f"eskin_{name}.h5"), name, out) for name in SKINS}
    write_whole(out / "results.json", json.dumps(results, indent=1))
    print(table(results))


def study(touches: SkinTouches, name: str, out: Path) -> dict[str, Any]:
    """Numbers of every method on one skin; draws its figures."""
    truth_mm = touches.place_mm[touches.held_out]
    setting, tuning_mm, tried = kernel_ridge.tuned(touches)
    print(f"{name}: kernel ridge {tuning_mm:.2f} mm on the tuning folds, {setting}", flush=True)
    chosen, network_tuning_mm = tuned_network(touches)
    said = {
        "mean": [np.tile(touches.place_mm[touches.early].mean(axis=0), (len(truth_mm), 1))],
        "ridge": [ridge(touches)],
        "kernel ridge": [kernel_ridge.predict(touches, setting)],
        "network ensemble": [],
    }
    for seed in SEEDS:
        said["network ensemble"].append(network(touches, chosen, seed))
    numbers = {method: summary(answers, touches) for method, answers in said.items()}
    errors = {method: errors_mm(answers[0], truth_mm) for method, answers in said.items()}
    write_whole(out / f"{name}_errors.png", png(error_distribution(errors)))
    write_whole(out / f"{name}_map.png", png(error_map(truth_mm, said["network ensemble"][0])))
    return {
        "methods": numbers,
        "kernel_ridge": {"setting": asdict(setting), "tuning_mm": tuning_mm, "settings_tried": tried},
        "network": {"settings": asdict(chosen), "tuning_mm": network_tuning_mm},
    }


def tuned_network(touches: SkinTouches) -> tuple[location_network.Settings, dict[str, float]]:
    """The best of ``TRIED``, by two members trained for half as long, on the later tuning fold."""
    train, test = touches.tuning_folds()[-1]
    found = {}
    for settings in TRIED:
        quick = replace(settings, members=2, epochs=settings.epochs // 2)
        said_mm = location_network.fit_predict(
            touches.response[train], touches.place_mm[train], touches.response[test], quick, seed=0
        )
        found[settings] = float(errors_mm(said_mm, touches.place_mm[test]).mean())
        print(f"  network {found[settings]:.3f} mm on the tuning fold, {settings}", flush=True)
    best = min(found, key=lambda settings: found[settings])
    return best, {f"scale {s.scale:g}, dropout {s.dropout:g}": error_mm for s, error_mm in found.items()}


def network(touches: SkinTouches, settings: location_network.Settings, seed: int) -> np.ndarray:
    """(500,2) places of the held-out touches, learned from all early ones."""
    early = touches.early
    return location_network.fit_predict(
        touches.response[early], touches.place_mm[early], touches.response[touches.held_out], settings, seed
    )


def ridge(touches: SkinTouches) -> np.ndarray:
    """(500,2) places by linear regression on the compressed responses, its penalty by leave-one-out."""
    train, test = (
        kernel_ridge.compressed(touches.response[rows], 1000.0) for rows in (touches.early, touches.held_out)
    )
    mean, spread = train.mean(axis=0), train.std(axis=0)
    fitted = RidgeCV(alphas=10.0 ** np.arange(-2, 5)).fit((train - mean) / spread, touches.place_mm[touches.early])
    return np.asarray(fitted.predict((test - mean) / spread))


def summary(answers: list[np.ndarray], touches: SkinTouches) -> dict[str, list[float]]:
    """Per seed: mean and median error in mm, the 95th percentile, and the hit rate on the 6x6 grid."""
    errors = [errors_mm(said_mm, touches.place_mm[touches.held_out]) for said_mm in answers]
    return {
        "mean_mm": [float(e.mean()) for e in errors],
        "median_mm": [float(np.median(e)) for e in errors],
        "percentile_95_mm": [float(np.percentile(e, 95)) for e in errors],
        "hit_rate": [hit_rate(said_mm, touches, touches.held_out) for said_mm in answers],
    }


def table(results: dict[str, Any]) -> str:
    """Markdown: a line per skin and method, mean ± standard deviation over the seeds."""
    lines = [
        "| skin | method | mean error / mm | median / mm | 95 % / mm | hit rate, 6x6 / % |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, skin in results.items():
        for method, numbers in skin["methods"].items():
            cells = [spread(numbers[key]) for key in ("mean_mm", "median_mm", "percentile_95_mm")]
            cells.append(spread([100 * rate for rate in numbers["hit_rate"]], digits=1))
            lines.append(f"| {name} | {method} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def spread(values: list[float], digits: int = 2) -> str:
    """Mean, with ± standard deviation where there is more than one."""
    mean = f"{np.mean(values):.{digits}f}"
    return mean if len(values) == 1 else f"{mean} ± {np.std(values, ddof=1):.{digits}f}"


if __name__ == "__main__":
    main()
