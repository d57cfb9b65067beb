"""Diagnose a recorded suite: ``python experiments/concealed/proof/diagnose.py OUT [--method NAME=COMMAND] [--jobs 2]``.

A method is a command line; ``{recording}`` and ``{out}`` stand for its input and its folder. Goes on where it stopped.
``--cpu-s 720`` stops a diagnosis that takes longer: it counts as none, and isn't made again.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import seals

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
STOPPED = "stopped.txt"
"""In the folder of a diagnosis that took too long: how long it was given."""
DIAGNOSE = f"ertskin={shlex.quote(sys.executable)} -m ertskin.cli diagnose recording={{recording}} out={{out}}"


def method(text: str) -> tuple[str, str]:
    """``NAME=COMMAND``; raises ``argparse.ArgumentTypeError`` for anything else."""
    name, _, command = text.partition("=")
    if not name or "{recording}" not in command or "{out}" not in command:
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=COMMAND with {{recording}} and {{out}} in it")
    return name, command


def diagnose(name: str, command: str, recording: Path, folder: Path, cpu_s: int | None = None) -> str:
    """Run one method on one recording; its output lies beside the diagnosis. Returns a line on how it went.

    One that takes more than ``cpu_s`` seconds of CPU is stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    words = shlex.split(command.format(recording=shlex.quote(str(recording)), out=shlex.quote(str(folder))))
    if cpu_s is not None:
        # The soft limit alone: its signal tells a diagnosis that took too long from one that was killed.
        words = ["sh", "-c", f'ulimit -S -t {cpu_s}; exec "$@"', "sh", *words]
    with (folder / "output.txt").open("w") as output:
        code = subprocess.run(
            words, stdout=output, stderr=subprocess.STDOUT, env=os.environ | ONE_THREAD, check=False
        ).returncode
    state = "diagnosed" if (folder / "diagnosis.json").exists() else f"no diagnosis (exit status {code})"
    if code == -signal.SIGXCPU and not (folder / "diagnosis.json").exists():
        state = f"stopped after {cpu_s} s of CPU"
        (folder / STOPPED).write_text(state + "\n")
    return f"{name} {recording.stem}: {state}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the suite")
    parser.add_argument("--method", type=method, action="append", help="NAME=COMMAND, several times if wanted")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cpu-s", type=int, help="seconds of CPU after which a diagnosis is stopped")
    options = parser.parse_args()
    out = options.out.resolve()
    try:
        cases = seals.read_json(out / "commitments.json")["cases"]
        for name, one in cases.items():
            if seals.file_hash(out / "recordings" / f"{name}.h5") != one["recording"]:
                raise seals.SealError(f"{name}: the recording's bytes are not those committed")
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    work = [
        (name, command, out / "recordings" / f"{case}.h5", folder, options.cpu_s)
        for name, command in options.method or [method(DIAGNOSE)]
        for case in cases
        if not any(
            ((folder := out / "diagnoses" / name / case) / made).exists() for made in ("diagnosis.json", STOPPED)
        )
    ]
    with ThreadPoolExecutor(options.jobs) as pool:
        for done in as_completed([pool.submit(diagnose, *piece) for piece in work]):
            print(done.result(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
