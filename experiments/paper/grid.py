"""How many sensing points does the skin carry? The sweep over grid sizes that the paper leaves open.

    python experiments/paper/grid.py RECORDING [--folder runs/grid]

Trains ``model=reciprocal`` for every grid with the same number of random pairs and the recording's measured noise, and
draws the metrics on simulated presses no network was trained on against the taxels' spacing.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt

GRIDS = (4, 6, 8, 10, 12)
METRICS = ("hit_rate_one", "force_rmse_one_n", "exact_rate_two", "force_error_two_n")
LABELS = ("one contact: exact / %", "one contact: force RMSE / N", "two contacts: exact / %", "two: force error / N")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording")
    parser.add_argument("--folder", type=Path, default=Path("runs/grid"))
    parser.add_argument("--steps", type=int, default=25, help="forces per taxel (paper: 100)")
    parser.add_argument("--pairs", type=int, default=9000, help="two-point trials (paper: 32400)")
    parser.add_argument("--seeds", default="0")
    chosen = parser.parse_args()
    grids = ",".join(f"{n}x{n}" for n in GRIDS)
    sweep = ["train", "-m", f"recording={chosen.recording}", f"grid={grids}", "model=reciprocal"]
    sweep += [f"seed={chosen.seeds}", f"out={chosen.folder}", f"data.plan.steps={chosen.steps}"]
    sweep += [f"data.plan.trials={chosen.pairs}", "data.plan.denoiser_trials=100", "data.discrepancy=false"]
    threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    subprocess.run([sys.executable, "-m", "ertskin.cli", *sweep], check=True, env={**os.environ, **threads})
    rows = table(chosen.folder)
    script_folder = Path(__file__).resolve().parent
    (script_folder / "grid.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    draw(rows, script_folder / "grid.png")
    for row in rows:
        print(row)


def table(folder: Path) -> list[dict[str, float]]:
    """One row for each finished job: taxels along a side, seed and metrics."""
    from ertskin.models.reconstruction import Reconstruction

    rows = []
    for done in folder.glob("*/done.json"):
        job = json.loads(done.read_text(encoding="utf-8"))
        about = Reconstruction.load(done.parent / "model.pt").about["config"]
        scores = {name.removeprefix("validation_"): value for name, value in job["metrics"].items()}
        rows.append(
            {"side": about["grid"]["columns"], "seed": about["seed"], **{name: scores[name] for name in METRICS}}
        )
    return sorted(rows, key=lambda row: (row["side"], row["seed"]))


def draw(rows: list[dict[str, float]], path: Path) -> None:
    """The four metrics against the number of taxels along a side."""
    figure, axes = plt.subplots(1, 4, figsize=(12, 2.8), layout="constrained")
    for axis, name, label in zip(axes, METRICS, LABELS, strict=True):
        scale = 100.0 if name.endswith(("one", "two")) and "rate" in name else 1.0
        axis.plot([row["side"] for row in rows], [scale * row[name] for row in rows], "o-", color="#0072b2", ms=4)
        axis.set_xlabel("taxels along a side of 120 mm")
        axis.set_ylabel(label)
        axis.set_xticks(GRIDS)
        axis.set_ylim(bottom=0)
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
