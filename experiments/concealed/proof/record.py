"""Record a suite and seal it: ``python experiments/concealed/proof/record.py OUT [--final] [--small] [--only c001]``.

The first call draws a secret into OUT/secret.txt: keep it to yourself until the score. Goes on where it stopped. When
all is recorded, OUT/commitments.json holds the seal of every truth and the hash of every recording: publish it
(``publish.py OUT SEED --commit``) before anything is diagnosed.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import secrets
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
if __name__ == "__main__":
    # The last bits hang on which kernels the processor has: these any with AVX2 has.
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
    os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", "X86_V4 AVX512_ICL AVX512_SPR")

import seals  # noqa: E402
from generator.effect import Effect  # noqa: E402
from generator.families import FAMILIES  # noqa: E402
from generator.file import write  # noqa: E402
from generator.forms import FORMS  # noqa: E402
from generator.recording import clean, measured  # noqa: E402
from generator.skin import Noise, Skin  # noqa: E402
from generator.skins import drawn, misdescribed  # noqa: E402
from generator.strength import Ruler  # noqa: E402
from suite import ODD, SPLIT, Case, Hidden, families, generator_of, suite  # noqa: E402


def made(hidden: Hidden, skin: Skin, size: float, seed: int) -> Effect:
    """An effect of this form and size, its places drawn on this skin."""
    kinds = FORMS.get(hidden.name) or (FAMILIES[hidden.name],)
    kind = next(k for k in kinds if k.form == hidden.form)
    effect = kind(size)
    effect.draw(skin, generator_of(seed.to_bytes(8, "big"), hidden.name, hidden.form))
    return effect


def skin_of(case: Case) -> Skin:
    """The skin of a case, without its effects."""
    noise = Noise(white_v=case.noise_v, coloured_share=case.coloured_share)
    skin = drawn(case.seed, case.shape, case.pad, case.scan, case.presses, noise)
    return misdescribed(skin) if case.wrong_guesses else skin


def truth_of(case: Case, skin: Skin) -> tuple[dict[str, Any], list[Effect]]:
    """What is sealed, and the effects themselves: sizes are settled first, so that the truth is what was simulated."""
    ruler = Ruler(skin) if case.hidden else None
    effects, said = [], []
    for hidden in case.hidden:
        assert ruler is not None
        size, ratio = ruler.size(lambda s, h=hidden: made(h, skin, s, case.seed), hidden.ratio)  # type: ignore[misc]
        effect = made(hidden, skin, size, case.seed)
        own = {key: float(f"{value:.3g}") for key, value in asdict(ratio).items()}
        said.append({
            **asdict(hidden), "listed": effect.listed, "size": size, "own": max(own.values()), **own,
            "details": effect.details, "meaning": effect.meaning(skin),
        })  # fmt: skip
        effects.append(effect)
    about = {key: value for key, value in asdict(case).items() if key not in ("hidden", "details")}
    return seals.rounded({**about, "point_m": skin.taxel_m.tolist(), "effects": said}), effects


def specimen_effects(case: Case, skin: Skin, effects: list[Effect]) -> list[Effect]:
    """What the piece of cloth in the compressometer does: as the skin, nothing, or something else."""
    if case.specimen == "same":
        return effects
    if case.specimen == "none":
        return []
    odd = ODD[case.specimen](0.35)
    odd.draw(skin, generator_of(case.seed.to_bytes(8, "big"), "specimen"))
    return [odd]


def record(case: Case, out: Path, secret: bytes) -> str:
    """Write one recording and its sealed truth; the recording is the last thing to appear."""
    skin = skin_of(case)
    truth, effects = truth_of(case, skin)
    nonce = seals.nonce(secret, case.name)
    found = clean(skin, effects)
    data = measured(skin, effects, specimen_effects(case, skin, effects), found)
    seals.write_json(out / "sealed" / f"{case.name}.json", {"truth": truth, "nonce": nonce})
    write(out / "recordings" / f"{case.name}.h5", skin, data, case.name)
    return case.name


def secret_of(out: Path) -> bytes:
    """The suite's secret, drawn at the first call."""
    path = out / "secret.txt"
    if not path.exists():
        out.mkdir(parents=True, exist_ok=True)
        path.write_text(secrets.token_hex(32) + "\n")
        path.chmod(0o600)
    return bytes.fromhex(path.read_text().strip())


def commitments(out: Path, cases: list[Case], secret: bytes, about: dict[str, Any]) -> dict[str, Any]:
    """Seal and byte hash of every recording made, the hash of the secret, what the suite was drawn with."""
    listed = {}
    for case in cases:
        path = out / "recordings" / f"{case.name}.h5"
        if path.exists():
            sealed = seals.read_json(out / "sealed" / f"{case.name}.json")
            listed[case.name] = {
                "truth": seals.seal(sealed["truth"], sealed["nonce"]),
                "recording": seals.file_hash(path),
            }
    return {"secret": hashlib.sha256(secret).hexdigest(), "suite": about, "cases": listed}


def record_all(cases: list[Case], out: Path, secret: bytes, jobs: int) -> Iterator[str]:
    """Record what is missing; yields names as they get done."""
    missing = [case for case in cases if not (out / "recordings" / f"{case.name}.h5").exists()]
    with ProcessPoolExecutor(max_workers=jobs) as pool:
        for done in as_completed([pool.submit(record, case, out, secret) for case in missing]):
            yield done.result()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the suite")
    parser.add_argument("--final", action="store_true", help="open the sealed families: the last run of a seed")
    parser.add_argument("--small", action="store_true", help="a suite of minutes instead of hours")
    parser.add_argument("--jobs", type=int, default=1, help="processes, one BLAS thread each")
    parser.add_argument("--only", nargs="*", help="names of cases, all without it")
    options = parser.parse_args()
    if options.final and not families(True):
        parser.error(f"no family is sealed any longer ({SPLIT.name}): new ones have to be written and sealed first")
    secret = secret_of(options.out)
    about = {"families": families(options.final)[: 1 if options.small else None], "small": options.small}
    cases = suite(secret, about["families"], options.small)
    unknown = set(options.only or ()) - {case.name for case in cases}
    if unknown:
        parser.error(f"no case named {', '.join(sorted(unknown))} in this suite of {len(cases)}")
    chosen = [case for case in cases if not options.only or case.name in options.only]
    for number, name in enumerate(record_all(chosen, options.out, secret, options.jobs), 1):
        print(f"{number}/{len(chosen)}: {name} recorded and sealed", flush=True)
    seals.write_json(options.out / "commitments.json", commitments(options.out, cases, secret, about))
    print(f"{options.out / 'commitments.json'}: publish it before anything is diagnosed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
