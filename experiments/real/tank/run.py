"""A water tank: which electrode reads wrong, and where the inclusions are.

    python experiments/real/tank/run.py DATA [OUT]

DATA holds real/ktc2023_tank_a.h5; results and figures go to OUT, this folder by default. The outlines under truth/ are
read after every map is made.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from baseline import one_step
from figures import curve_figure, maps_figure
from numpy.typing import NDArray

from ertskin.diagnosis.tank.diagnosis import noise_v
from ertskin.diagnosis.tank.electrode_error import column_errors, corrected, electrode_errors, rms_v
from ertskin.diagnosis.tank.figures import electrode_figure
from ertskin.diagnosis.tank.inclusions import Imaging, InclusionMap, bend
from ertskin.files import write_whole
from ertskin.hardware.recording import read_recording
from ertskin.physics.protocol import Protocol
from ertskin.report.figures.image import save_png

Array = NDArray[np.float64]

NULLS, SEED = 200, 0
OURS = "iterated, total variation, readings by their noise"


def main() -> None:
    """The electrodes of every frame; a false-alarm rate; the maps of frames 1 and 2 by several methods."""
    path = Path(sys.argv[1]) / "real" / "ktc2023_tank_a.h5"
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    recording = read_recording(path)
    assert recording.sensor is not None
    assert recording.protocol is not None
    assert recording.frames is not None
    protocol, voltage = recording.protocol, np.asarray(recording.frames.voltage_v, dtype=float)
    results: dict[str, Any] = {"electrodes": electrodes(protocol, voltage)}
    results["nulls"] = nulls(protocol, voltage[0])
    print(results, flush=True)
    imaging = Imaging(recording.sensor, protocol, voltage[0])
    paths = {frame: list(imaging.path(voltage[frame])) for frame in (1, 2)}
    maps = {frame: methods(imaging, voltage[frame]) | {OURS: bend(mine)} for frame, mine in paths.items()}
    truths = {frame: truth(path, frame) for frame in maps}
    results["correlation"] = {
        name: [correlation(one[name], *truths[frame]) for frame, one in maps.items()] for name in maps[1]
    }
    results["path"] = {
        frame: [
            {"weight": one.weight, "misfit": one.misfit, "variation": one.variation}
            | {"correlation": correlation(one, *truths[frame])}
            for one in paths[frame]
        ]
        for frame in paths
    }
    results["chosen weight"] = [one[OURS].weight for one in maps.values()]
    write_whole(out / "results.json", json.dumps(results, indent=1) + "\n")
    errors = electrode_errors(protocol, voltage[0])
    left = (
        electrode_errors(protocol, corrected(protocol, voltage[0], errors.weights(protocol)[0]))
        if errors.named
        else None
    )
    save_png(electrode_figure(errors, left), out / "electrodes.png")
    save_png(maps_figure(recording.sensor, maps, truths), out / "maps.png")
    save_png(curve_figure(results["path"], results["chosen weight"]), out / "curve.png")
    print(table(results))


def electrodes(protocol: Protocol, voltage_v: Array) -> dict[str, Any]:
    """Frame by frame: who stands out, how surely, and what is left when its columns are mended, over the noise."""
    noise = noise_v(protocol, voltage_v)
    found: dict[str, Any] = {"noise_v": noise, "frames": []}
    for scan in voltage_v:
        errors = electrode_errors(protocol, scan)
        mended = scan
        for weight in errors.weights(protocol):
            mended = corrected(protocol, mended, weight)
        found["frames"].append(
            {
                "named": errors.named,
                "p_value": errors.p_value,
                "p_next": errors.p_left,
                "rms_v": errors.rms_v.tolist(),
                "ratio_before": rms_v(protocol, scan) / noise,
                "ratio_after": rms_v(protocol, mended) / noise,
                "unexplained_v": rms_v(protocol, scan),
                "unexplained_beside_offsets_v": unexplained_with_offsets_v(protocol, scan),
                "columns": [vars(c) for w in errors.weights(protocol) for c in column_errors(protocol, scan, w)],
            }
        )
    return found


def unexplained_with_offsets_v(protocol: Protocol, scan_v: Array) -> float:
    """Rms in volt, per degree of freedom, of what neither a network nor an offset of every column explains."""
    offsets = np.tile(np.eye(protocol.shape[1]), (protocol.shape[0], 1))
    known = np.linalg.qr(np.column_stack([protocol.orthonormal, offsets]))[0]
    left = scan_v.ravel() - known @ (known.T @ scan_v.ravel())
    return float(np.sqrt((left**2).sum() / (left.size - known.shape[1])))


def nulls(protocol: Protocol, scan_v: Array) -> dict[str, float]:
    """Share of made-up scans without a bad electrode in which one is named.

    Their errors are as uneven as the real scan's: log-normal factors of columns and of injections with the spread that
    the real ones have beside electrode 30.
    """
    rng = np.random.default_rng(SEED)
    rms = electrode_errors(protocol, scan_v).rms_v
    spread = float(np.log(np.delete(rms, [29, 30, 31])).std(ddof=1))
    named = 0
    for _ in range(NULLS):
        column, injection = (np.exp(spread * rng.standard_normal(n)) for n in protocol.shape[::-1])
        made = injection[:, None] * column * rng.standard_normal(protocol.shape)
        named += bool(electrode_errors(protocol, made).named)
    return {"scans": NULLS, "seed": SEED, "spread": spread, "named": named}


def methods(imaging: Imaging, voltage_v: Array) -> dict[str, InclusionMap]:
    """One frame's map by every other method, their smoothness chosen by the readings alone."""
    alike = np.full(imaging.protocol.shape, 1e-6)
    return {
        "one step, smooth, all readings alike": one_step(imaging, voltage_v, alike),
        "one step, smooth, readings by their noise": one_step(imaging, voltage_v),
        "iterated, total variation, all readings alike": imaging.image(voltage_v, alike),
    }


def truth(path: Path, frame: int) -> tuple[Array, Array]:
    """Pixel centres (n,2) in metre inside the tank and what is there (n,): -1 resistive, 0 water, 1 conductive."""
    with h5py.File(path) as file:
        image = file["truth/segmentation"][frame]
        radius_m = float(np.abs(file["sensor/outline_m"][:]).max())
    size = len(image)
    at = radius_m * ((np.arange(size) + 0.5) * 2 / size - 1)
    x, y = np.meshgrid(at, at[::-1])
    place_m = np.stack([x, y], axis=-1).reshape(-1, 2)
    inside = np.linalg.norm(place_m, axis=1) < 0.995 * radius_m
    return place_m[inside], np.choose(image.ravel(), [0.0, -1.0, 1.0])[inside]


def correlation(one: InclusionMap, place_m: Array, sign: Array) -> float:
    """Pearson's, of the log ratio with the truth, over the tank's pixels."""
    return float(np.corrcoef(np.nan_to_num(one.at(place_m)), sign)[0, 1])


def table(results: dict[str, Any]) -> str:
    """Markdown: correlations by method, electrodes by frame."""
    lines = ["| map | frame 1 | frame 2 |", "| --- | --- | --- |"]
    lines += [
        f"| {name} | " + " | ".join(f"{c:.3f}" for c in row) + " |" for name, row in results["correlation"].items()
    ]
    head = "frame | named | p | p of the next | misfit over noise | with its columns mended"
    lines += ["", f"| {head} |", "| --- " * 6 + "|"]
    for k, frame in enumerate(results["electrodes"]["frames"]):
        named, chance = ", ".join(map(str, frame["named"])), ", ".join(f"{p:.3f}" for p in frame["p_value"])
        ratios = f"{frame['ratio_before']:.1f} | {frame['ratio_after']:.1f}"
        lines.append(f"| {k} | {named} | {chance} | {frame['p_next']:.2f} | {ratios} |")
    null = results["nulls"]
    return "\n".join([*lines, "", f"{null['named']} of {null['scans']} scans without a bad electrode blame one."])


if __name__ == "__main__":
    main()
