"""The whole study in one command: ``python experiments/concealed/rerun.py OUT [--small]``, then ``score.py OUT``.

Writes and seals what is missing, then diagnoses every recording that has no ``diagnosis.json`` yet, one process each.
A method is a command line; ``{recording}`` and ``{out}`` stand for its input and its folder. Without ``--method`` it is
the diagnosis itself. ``--cluster`` takes the choices of ``ertskin diagnose``; its workers must see OUT.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generate import arguments, chosen, generate
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from ertskin.configuration import choices, config_dir

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
DIAGNOSE = "ertskin diagnose recording={recording} out={out}"


@dataclass(frozen=True)
class Method:
    """A diagnosis to be judged: its name in the table and how it is run."""

    name: str
    command: str

    @classmethod
    def parse(cls, text: str) -> Method:
        """``name=command``; raises ``argparse.ArgumentTypeError`` for anything else."""
        name, _, command = text.partition("=")
        if not name or "{recording}" not in command or "{out}" not in command:
            raise argparse.ArgumentTypeError(f"{text!r} is not NAME=COMMAND with {{recording}} and {{out}} in it")
        return cls(name, command)


def diagnose(method: Method, recording: Path, folder: Path) -> str:
    """Run one method on one recording; returns one line on how it went. Its output lies beside the diagnosis."""
    folder.mkdir(parents=True, exist_ok=True)
    command = shlex.split(method.command.format(recording=shlex.quote(str(recording)), out=shlex.quote(str(folder))))
    with (folder / "output.txt").open("w") as output:
        done = subprocess.run(
            command, stdout=output, stderr=subprocess.STDOUT, env=os.environ | ONE_THREAD, check=False
        )
    state = "diagnosed" if (folder / "diagnosis.json").exists() else f"no diagnosis (exit status {done.returncode})"
    return f"{method.name} {recording.stem}: {state}"


@dataclass(frozen=True)
class Diagnoses:
    """Piece ``number``: one method on one recording into one folder; travels to workers that see the same files."""

    pieces: tuple[tuple[Method, Path, Path], ...]

    def __call__(self, number: int) -> str:
        """One line on how it went."""
        return diagnose(*self.pieces[number])


def diagnose_all(methods: list[Method], names: list[str], out: Path, cluster: Any) -> Iterator[str]:
    """Every method on every recording not diagnosed yet; yields a line as each gets done."""
    pieces = tuple(
        (method, out / "recordings" / f"{name}.h5", folder)
        for method in methods
        for name in names
        if not ((folder := out / "diagnoses" / method.name / name) / "diagnosis.json").exists()
    )
    for _, line in cluster.spread(Diagnoses(pieces), range(len(pieces))):
        yield line


def cluster_of(name: str, *settings: str) -> Any:
    """The cluster of ``conf/cluster/NAME.yaml`` with settings ``key=value``; ``SystemExit`` for an unknown name."""
    if name not in choices("cluster"):
        raise SystemExit(f"no cluster named {name}; there are {', '.join(choices('cluster'))}")
    with initialize_config_dir(str(config_dir() / "cluster"), version_base="1.3"):
        return instantiate(compose(name, list(settings)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    arguments(parser)
    parser.add_argument("--method", action="append", type=Method.parse, help="NAME=COMMAND; may be given several times")
    parser.add_argument("--cluster", nargs="+", metavar=("NAME", "KEY=VALUE"), help="local, dask or slurm, settings")
    options = parser.parse_args()
    cluster = cluster_of(*(options.cluster or ("local", f"workers={options.jobs}")))
    cases = chosen(options)
    for name in generate(cases, options.out, options.jobs):
        print(f"{name}: recorded and sealed", flush=True)
    methods = options.method or [Method("ertskin", DIAGNOSE)]
    for line in diagnose_all(methods, [case.name for case in cases], options.out.resolve(), cluster):
        print(line, flush=True)
    print(f"score with: python {Path(__file__).with_name('score.py')} {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
