"""Write the suite's recordings and seal their truths: ``python experiments/concealed/generate.py OUT [--small]``.

Goes on where it stopped: a recording whose seal lies beside it is done. The same seed writes the same suite.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from cases import Case, suite  # noqa: E402

from ertskin.hardware.recording import write_recording  # noqa: E402
from ertskin.hardware.virtual.bench import Bench, Truth, draw_truth  # noqa: E402
from ertskin.hardware.virtual.bench.sealing import seal  # noqa: E402
from ertskin.hardware.virtual.bench.strength import Ruler  # noqa: E402
from ertskin.physics.sensor import Sensor  # noqa: E402


def arguments(parser: argparse.ArgumentParser) -> None:
    """What both generating and rerunning take."""
    parser.add_argument("out", type=Path, help="folder of the suite")
    parser.add_argument("--small", action="store_true", help="the suite of minutes instead of hours")
    parser.add_argument("--seed", type=int, default=1, help="another seed, another suite")
    parser.add_argument("--jobs", type=int, default=1, help="processes, one BLAS thread each")
    parser.add_argument("--only", nargs="*", help="names of cases, all without it")
    parser.add_argument("--plan", help="record on this plan (quick: 12 presses) instead of the suite's own")


def chosen(options: argparse.Namespace) -> list[Case]:
    """The cases asked for; raises ``SystemExit`` with one line for an unknown name."""
    cases = suite(options.seed, options.small)
    unknown = set(options.only or ()) - {case.name for case in cases}
    if unknown:
        raise SystemExit(f"no case named {sorted(unknown)} in this suite of {len(cases)}")
    picked = [case for case in cases if not options.only or case.name in options.only]
    if options.plan is None:
        return picked
    return [case if case.kind == "blind" else replace(case, plan=options.plan) for case in picked]


def draw(case: Case) -> tuple[Truth, dict[str, Any]]:
    """The truth of a case's skin, and what is sealed about it (class, plan, own ratios)."""
    ruler = Ruler(case.seed, case.noise.white_v, case.noise.force_n)
    strengths: dict[str, float] = {}
    own: dict[str, dict[str, float]] = {}
    for name, ratio in case.ratios.items():
        strengths[name], reached = ruler.strength(name, ratio)
        own[name] = {"asked": ratio, "own": reached.own, "voltage": reached.voltage}
        own[name] |= {"reciprocal": reached.reciprocal, "force": reached.force}
    truth = draw_truth(ruler.sensor, case.seed, strengths, case.noise)
    return truth, {"kind": case.kind, "plan": case.plan, "ratios": own}


def write_case(case: Case, out: Path) -> str:
    """Record one hidden skin and seal its truth; returns the commitment."""
    truth, about = draw(case)
    recording = replace(Bench(truth).recording(case.plan), rig=case.name, comment="")
    if case.wrong_guesses and recording.sensor is not None:
        recording = replace(recording, sensor=_misdescribed(recording.sensor))
    path = out / "recordings" / f"{case.name}.h5"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_recording(path, recording)
    return seal(path, truth, out / "sealed", about)


def _misdescribed(sensor: Sensor) -> Sensor:
    """A maker's description that is off: foam, all fabrics alike, sheet resistance and contact resistance."""
    share = {layer.name: 0.8 if "fabric" in layer.name else 1.6 for layer in sensor.layers if layer.name != "glue"}
    wrong = sensor.with_layers(
        **{layer.name: share[layer.name] * layer.youngs_modulus_pa for layer in sensor.layers if layer.name in share}
    )
    sheet_ohm = 0.85 * sensor.sheet_resistance_ohm_sq
    return replace(wrong, sheet_resistance_ohm_sq=sheet_ohm, contact_resistance_guess_ohm=1e3)


def generate(cases: list[Case], out: Path, jobs: int) -> Iterator[str]:
    """Write what is not there yet; yields the names as they get done."""
    _settle_what(cases, out)
    missing = [case for case in cases if not (out / "recordings" / f"{case.name}.seal.json").exists()]
    with ProcessPoolExecutor(max_workers=jobs) as pool:
        pending = {pool.submit(write_case, case, out): case.name for case in missing}
        for done in as_completed(pending):
            done.result()
            yield pending[done]
    _list_seals(out)


def _settle_what(cases: list[Case], out: Path) -> None:
    """Raises ``SystemExit`` where the folder holds cases of another seed, size or plan; else notes these."""
    noted = out / "cases.json"
    known = json.loads(noted.read_text()) if noted.exists() else {}
    asked = {case.name: [case.seed, case.kind, case.plan] for case in cases}
    other = sorted(name for name, what in asked.items() if known.get(name, what) != what)
    if other:
        raise SystemExit(
            f"{out} holds other cases by these names ({other[0]}, …): another seed, size or plan; use another folder"
        )
    out.mkdir(parents=True, exist_ok=True)
    _write_json(noted, known | asked)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    """Aside, under a name of its own for processes side by side, then renamed."""
    aside = path.with_name(f"{path.name}.{os.getpid()}.part")
    aside.write_text(json.dumps(content, indent=1, sort_keys=True) + "\n")
    os.replace(aside, path)


def _list_seals(out: Path) -> None:
    """One file with every commitment: publish this before anything is diagnosed."""
    seals = sorted((out / "recordings").glob("*.seal.json"))
    listed = {path.name.split(".")[0]: json.loads(path.read_text())["sha256"] for path in seals}
    _write_json(out / "seals.json", listed)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    arguments(parser)
    options = parser.parse_args()
    cases = chosen(options)
    for number, name in enumerate(generate(cases, options.out, options.jobs), 1):
        print(f"{number}: {name} recorded and sealed", flush=True)
    print(f"{len(cases)} recordings in {options.out / 'recordings'}; commitments in {options.out / 'seals.json'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
