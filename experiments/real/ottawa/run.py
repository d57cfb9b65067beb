"""A tank that its file calls round: what the diagnosis says, and the places found against photographs.

    python experiments/real/ottawa/run.py DATA [OUT]

DATA holds real/ottawa_round.h5 and real/ottawa_squeezed.h5; OUT, this folder by default, the cases.json and
instruments.json that nulls.py has written. The photographs are read last, and only compared with.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from figures import place_figure, simulated_figure
from nulls import numbers, summary
from numpy.typing import NDArray
from photographs import angles_alone, blur, expected_shift

from ertskin.diagnosis.tank.diagnosis import diagnose_tank
from ertskin.files import write_whole
from ertskin.hardware.recording import read_recording
from ertskin.report.figures.image import save_png

Array = NDArray[np.float64]
TANKS = ("round", "squeezed")
RADIUS_M = 0.15


def main() -> None:
    """Diagnose both tanks, then open the photographs; sum up the simulated cases."""
    data = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    paths = {tank: data / "real" / f"ottawa_{tank}.h5" for tank in TANKS}
    said = {tank: diagnosed(path) for tank, path in paths.items()}
    photographed = {tank: photographs(path, np.array(said[tank]["shift"])) for tank, path in paths.items()}
    cases = json.loads((out / "cases.json").read_text())
    instruments = {
        key: np.quantile(values, [0.5, 0.95, 0.99, 1.0]).round(5).tolist()
        for key, values in json.loads((out / "instruments.json").read_text()).items()
    }
    results = {"tanks": said, "photographs": photographed, "simulated": summary(cases), "instruments": instruments}
    write_whole(out / "results.json", json.dumps(results, indent=1) + "\n")
    save_png(place_figure(said, photographed), out / "places.png")
    save_png(simulated_figure(cases), out / "simulated.png")
    print(table(results))


def diagnosed(path: Path) -> dict[str, Any]:
    """What ``ertskin diagnose`` says of a tank; shifts along the rim over its radius."""
    found = diagnose_tank(read_recording(path), path.name).diagnosis.as_builtins()
    placement = found["placement"]
    return {
        "verdict": found["verdict"],
        "effects": [
            {
                "name": e["name"],
                "electrode": e["parameters"].get("electrode", {}).get("value"),
                "confidence": e["confidence"],
            }
            for e in found["effects"]
        ],
        "misfit_before": placement["misfit_before"],
        "misfit_after": placement["misfit_after"],
        "shift": (numbers(placement["shift_along_rim_m"]) / RADIUS_M).round(4).tolist(),
    }


def photographs(path: Path, shift: Array) -> list[dict[str, Any]]:
    """Each frame's photograph against the shifts (16,) found: as a conformal map takes it to the disk, and without."""
    with h5py.File(path) as file:
        center_m = file["truth/electrode_center_m"][()]
    rows = []
    for one in center_m:
        expected, alone = expected_shift(one), angles_alone(one)
        rows.append(
            {
                "expected": expected.round(4).tolist(),
                "off": _rms(shift - expected),
                "off_without_map": _rms(shift - alone),
                "size": _rms(expected),
                "correlation": float(np.corrcoef(shift, expected)[0, 1]),
                "blur": blur(one, RADIUS_M),
            }
        )
    return rows


def _rms(value: Array) -> float:
    return float(np.sqrt(np.mean(value**2)))


def table(results: dict[str, Any]) -> str:
    """The README's tables."""
    lines = ["| tank | said | misfit held out, places in the file | electrodes moved |", "| --- | --- | --- | --- |"]
    for tank, one in results["tanks"].items():
        sure = [e["confidence"] for e in one["effects"]]
        names = f"`{one['effects'][0]['name']}` of {len(sure)} ({min(sure):.2f} to {max(sure):.2f})" if sure else ""
        lines.append(
            f"| {tank} | `{one['verdict']}` {names} | {one['misfit_before']:.2f} | {one['misfit_after']:.2f} |"
        )
    lines += [
        "",
        "| photograph | expected shifts, rms | found beside them, rms | without the conformal map | correlation |",
    ]
    lines.append("| --- | --- | --- | --- | --- |")
    for tank, rows in results["photographs"].items():
        for k, row in enumerate(rows):
            lines.append(
                f"| {tank}, frame {k} | {row['size']:.3f} ± {row['blur']:.3f} | {row['off']:.3f} | "
                f"{row['off_without_map']:.3f} | {row['correlation']:.3f} |"
            )
    lines += [
        "",
        "| simulated | tanks | out of place named | fault blamed | another blamed | shifts off, rms |",
    ]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    for kind, row in results["simulated"]["rows"].items():
        blamed = row["fault_blamed"] if "faulty" in kind else ""
        lines.append(
            f"| {kind} | {row['cases']} | {row['named']} | {blamed} | {row['wrongly_blamed']} | {row['off_rms']:.3f} |"
        )
    lines += ["", "| largest true shift, over the radius | tanks | named |", "| --- | --- | --- |"]
    lines += [f"| {p['from']:g} to {p['to']:g} | {p['cases']} | {p['named']} |" for p in results["simulated"]["power"]]
    simulated = results["simulated"]
    return "\n".join([*lines, "", *(f"{k}: {simulated[k]}" for k in ("nulls_largest", "spread", "reliability")),
                      f"instruments: {results['instruments']}"])  # fmt: skip


if __name__ == "__main__":
    main()
