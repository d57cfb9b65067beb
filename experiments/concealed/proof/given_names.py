"""What the search could have found: missed skins diagnosed with the hidden names alone in the library of effects.

``python …/proof/given_names.py RESULTS RECORDINGS OUT [--only c003 …] [--jobs N]``. RESULTS is the folder of an opened
sample, RECORDINGS its recordings (``record.py`` makes them again of the secret it holds); OUT/all and OUT/given keep
every diagnosis, so that the same command goes on where it stopped. Asked again are single effects whose first name, and
compounds of which a name, wasn't right: by the code at hand with all names, and where that doesn't name them right
either with those hidden alone. What comes out right then was lost by the choice of names; what doesn't is not in what
the presses show, or not in the model's forms and maps. It is no bound of a diagnosis as a whole: names without rivals
are surer than they may be, and pads found out of place at rest, contacts that wander and a converter's limit are looked
for all the same. OUT is for one state of the code: what lies there isn't made again.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Collection, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import replace
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import patch

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import seals  # noqa: E402
from judged import LIKELY, DiagnosisError, Judged  # noqa: E402
from opened_sample import METHOD, judged, opened  # noqa: E402

from ertskin.diagnosis.output.diagnosis_file import finite  # noqa: E402
from ertskin.diagnosis.search import candidates  # noqa: E402
from ertskin.diagnosis.skin import diagnose  # noqa: E402
from ertskin.files import write_whole  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402
from ertskin.physics.effects.effect import Effect  # noqa: E402
from ertskin.physics.effects.hypothesis import Signal  # noqa: E402
from ertskin.physics.effects.registry import effects_shown_by  # noqa: E402


def missed(case: Judged) -> bool:
    """Whether a single effect or a compound wasn't named right."""
    if case.kind == "single":
        return case.first_right < 1
    return case.kind == "compound" and not case.all_found


@contextmanager
def given(names: Collection[str]) -> Iterator[None]:
    """The diagnosis with the effects of these names alone, wherever a signal is asked for those it shows."""

    def among(signal: Signal) -> list[type[Effect]]:
        return [kind for kind in effects_shown_by(signal) if kind.name in names]

    pads = candidates._pads
    asking = [module for name, module in sys.modules.items() if name.startswith("ertskin.diagnosis")]
    with ExitStack() as switched:
        for module in asking:
            if hasattr(module, "effects_shown_by"):
                switched.enter_context(patch.object(module, "effects_shown_by", among))
        switched.enter_context(
            patch.object(candidates, "_pads", lambda *fit: [one for one in pads(*fit) if one.effect.name in names])
        )
        yield


def again(recording: Path, names: Collection[str], out: Path) -> dict[str, Any]:
    """What a diagnosis says that is given the ``names``, made once; with all of them where none are."""
    file = out / ("given" if names else "all") / recording.stem / "diagnosis.json"
    if not file.is_file():
        with given(names) if names else nullcontext():
            found = diagnose(read_recording(recording), recording.name, lambda share, text: None)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(finite(found.diagnosis.as_builtins()), indent=1))
    return dict(json.loads(file.read_text(encoding="utf-8")))


def row(case: Judged, recordings: Path, out: Path) -> str:
    """A line of the table: what is hidden, what was said on the day, what is said now and given the names."""
    recording, names = recordings / f"{case.name}.h5", [one["name"] for one in case.hidden]
    now = replace(case, diagnosis=again(recording, (), out))
    only = replace(case, diagnosis=again(recording, names, out)) if missed(now) else None
    lost = "right now" if only is None else "even so" if missed(only) else "the choice"
    hidden = ", ".join(f"`{one['name']}`/{one['form']} {one['own']:.2f}" for one in case.hidden)
    cells = said(case), said(now), "" if only is None else said(only)
    return f"| {case.name}, {case.truth['presses']} | {hidden} | {' | '.join(cells)} | {lost} |"


def said(case: Judged) -> str:
    """Names that aren't all but excluded, and what is left held out."""
    names = [
        f"{'' if case.is_right(one) else 'wrong: '}`{one['name']}` {one['confidence']:.2f}"
        for one in case.claims
        if one["confidence"] >= LIKELY / 10
    ]
    return f"{', '.join(names) or case.verdict}; {case.held_out('ratio_after'):.3f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path, help="the folder of an opened sample")
    parser.add_argument("recordings", type=Path, help="the folder of its recordings")
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="*", help="names of cases, all that were missed without it")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    try:
        cases = [one for one in judged(options.results, opened(options.results))[METHOD] if missed(one)]
    except (seals.SealError, DiagnosisError) as error:
        parser.exit(2, f"{error}\n")
    cases = [one for one in cases if not options.only or one.name in options.only]
    lacking = [one.name for one in cases if not (options.recordings / f"{one.name}.h5").is_file()]
    if lacking:
        parser.exit(2, f"{options.recordings}: no recording of {', '.join(lacking)}; record.py makes them\n")
    print("| case, presses | hidden, own ratio | said; left held out | now | given the names | lost by |")
    print("| --- " * 6 + "|", flush=True)
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        for line in pool.map(row, cases, repeat(options.recordings), repeat(options.out)):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
