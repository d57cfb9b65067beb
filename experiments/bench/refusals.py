"""Bad recordings through every command that reads one: ``python experiments/bench/refusals.py [CASES] [SEED]``.

Writes refusals.md. The rule: status 0 or 2, never a traceback, one line where a recording is refused, at most 2 GB, and
two seconds of processor time for a refusal, beyond what it takes to load the program. The corpus is drawn in an order
of the seed's, all of it or the first so many cases. What ``doctor`` refuses goes through three of the other commands,
in turn; what it accepts through all of them. Each command runs in a process forked from one that has everything loaded.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import cycle, islice
from pathlib import Path

import h5py
import numpy as np

TESTS = Path(__file__).resolve().parents[2] / "tests"
sys.path[:0] = [str(TESTS / "hardware"), str(TESTS / "ertskin")]
from bad_recordings import REFUSED, overwritten, spoilt, systematic  # noqa: E402
from small_bench import write_small_bench  # noqa: E402

from ertskin import cli  # noqa: E402
from ertskin.hardware.recorder import part_of  # noqa: E402
from ertskin.hardware.recording import UNFINISHED, read_recording  # noqa: E402

MOST_BYTES = 2 * 2**30
REFUSAL_S = 2.0
STARTING_S = 2.0
"""What ``run`` may take for starting the step that refuses, a program of its own."""
PATIENCE_S = 300
FEW_TRIALS = ["data=smoke", "data.plan.steps=5", "data.plan.trials=100", "data.plan.denoiser_trials=20"]
SHORT = ["model=reciprocal", "trainer.max_epochs=1", "trainer.accelerator=cpu", *FEW_TRIALS]
MEAN = ["yardsticks=[mean]", *FEW_TRIALS]
OVERWRITTEN = 20

COMMANDS: dict[str, list[str]] = {
    "doctor": ["doctor", "recording=bad.h5"],
    "calibrate": ["calibrate", "recording=bad.h5"],
    "diagnose": ["diagnose", "recording=bad.h5"],
    "diagnose, retraining": ["diagnose", "recording=absent.h5", "retrain=true", "one=bad.h5"],
    "synthesize": ["synthesize", "recording=bad.h5", *FEW_TRIALS],
    "train": ["train", "recording=bad.h5", *SHORT],
    "evaluate": ["evaluate", "recording=bad.h5", "one=one.h5", "models=[model.pt]", *MEAN],
    "evaluate, one": ["evaluate", "recording=train.h5", "one=bad.h5", "models=[model.pt]", *MEAN],
    "evaluate, two": ["evaluate", "recording=train.h5", "two=bad.h5", "models=[model.pt]", *MEAN],
    "evaluate, anywhere": ["evaluate", "recording=train.h5", "anywhere=bad.h5", "models=[model.pt]", *MEAN],
    "live": ["live", "recording=bad.h5", "network=model.pt", "stream=true", "speed=0"],
    "run": ["run", "recording=bad.h5", "models=[reciprocal]", "seeds=[0]", "jobs=1", *SHORT[1:]],
    "record, there already": ["record", "recording=bad.h5"],
    "record, gone on with": ["record", "recording=half.h5", "plan=listed"],
    "import": ["import", "source=bad.h5", "out=imported.h5"],
}
"""The words of each; ``bad.h5`` is the bad recording, ``half.h5`` a half-done one made bad in the same way."""
IN_TURN = 3
WHERE_READ = [name for name in COMMANDS if name not in ("doctor", "run")]
"""Commands for a case that ``doctor`` accepts; the steps of ``run`` are the others."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended: ``status`` is minus the signal where one ended it; processor time with its children's."""

    status: int
    said: str
    processor_s: float
    bytes: int

    def faults(self, limit_s: float = REFUSAL_S) -> list[str]:
        """What breaks the rule, a refusal taking ``limit_s`` of processor time at most."""
        lines = [line for line in self.said.splitlines() if line.startswith("ertskin: ")]
        found = []
        if self.status not in (0, 2):
            found.append(f"status {self.status}")
        if "Traceback" in self.said:
            found.append("traceback")
        if self.status == 2 and len(lines) != 1:
            found.append(f"{len(lines)} lines")
        if self.status == 2 and self.processor_s > limit_s:
            found.append(f"refused after {self.processor_s:.1f} s")
        if self.bytes > MOST_BYTES:
            found.append(f"{self.bytes / 2**30:.1f} GB")
        return found


def ended(words: Sequence[str], said: Path) -> Outcome:
    """Run a command in a process forked from this one; what it says goes to the file ``said``."""
    child = os.fork()
    if child == 0:
        _become(words, said)
    timer = time.monotonic() + PATIENCE_S
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > timer:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.01)
    text = said.read_text(encoding="utf-8", errors="replace")
    return Outcome(os.waitstatus_to_exitcode(status), text, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss)


def _become(words: Sequence[str], said: Path) -> None:
    """In the child: only the command's words reach the file, and nothing of the parent's is cleaned up."""
    status = 1
    try:
        handle = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(handle, 1)
        os.dup2(handle, 2)
        status = cli.main(list(words))
    except SystemExit as error:
        status = error.code if isinstance(error.code, int) else 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def corpus(seed: int) -> list[tuple[str, Callable[[Path, Path], Path]]]:
    """Name of each case, and what makes a bad copy of a good recording, in an order of the seed's."""
    cases: list[tuple[str, Callable[[Path, Path], Path]]] = []
    for name, change in [*REFUSED.items(), *systematic()]:
        cases.append((name, partial(spoilt, change=change)))
    for number in range(OVERWRITTEN):
        cases.append((f"bytes overwritten, {number}", partial(overwritten, seed=number)))
    return [cases[number] for number in np.random.default_rng(seed).permutation(len(cases))]


def prepare() -> None:
    """In the folder this runs in: good recordings, a half-done one and a network; everything loaded on the way."""
    write_small_bench(Path())
    for words in (["train", "recording=train.h5", *SHORT], ["doctor", "recording=train.h5"]):
        assert cli.main(words) == 0
    shutil.copyfile(next(Path("runs/train").glob("*/model.pt")), "model.pt")
    for name in ("calibrate", "diagnose", "evaluate, one", "live"):
        assert cli.main([word.replace("bad.h5", "train.h5") for word in COMMANDS[name]]) == 0
    assert cli.main(["record", "recording=begun.h5", "plan=listed"]) == 0


def half_done(good: Path, part: Path) -> None:
    """Make of a whole recording of ``plan=listed`` one that was cut off in its last press."""
    from hydra import compose, initialize_config_dir
    from omegaconf import OmegaConf

    from ertskin.bench.plan_choice import chosen_plan
    from ertskin.configuration import config_dir

    sensor = read_recording(good).sensor
    assert sensor is not None
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        fields = OmegaConf.to_container(compose("record", ["plan=listed"]).plan, resolve=True)
    plan = chosen_plan(fields, sensor)
    shutil.copyfile(good, part)
    with h5py.File(part, "r+") as file:
        file["frames"].attrs[UNFINISHED] = True
        file["frames"].attrs["plan"] = json.dumps(plan.as_dict())
        for name in list(file["frames"]):
            rows = file["frames"][name][:-4]
            del file["frames"][name]
            file["frames"][name] = rows


@dataclass
class Tally:
    """What came of one command over the corpus; a refusal may take ``limit_s`` of processor time."""

    limit_s: float
    cases: int = 0
    refused: int = 0
    longest_refusal_s: float = 0.0
    most_bytes: int = 0
    broken: list[str] = field(default_factory=list)

    def add(self, case: str, outcome: Outcome) -> None:
        """Count an outcome; one that breaks the rule is said at once."""
        self.cases += 1
        self.most_bytes = max(self.most_bytes, outcome.bytes)
        if outcome.status == 2:
            self.refused += 1
            self.longest_refusal_s = max(self.longest_refusal_s, outcome.processor_s)
        if faults := outcome.faults(self.limit_s):
            self.broken.append(f"{case}: {', '.join(faults)}")
            print(f"{self.broken[-1]}\n{outcome.said.strip()[-600:]}", flush=True)


def main(most: int = 10_000, seed: int = 0) -> None:
    """Prepare, send the cases through the commands, write the table after each."""
    tallies = {name: Tally(REFUSAL_S + (STARTING_S if name == "run" else 0.0)) for name in COMMANDS}
    others = cycle(name for name in COMMANDS if name != "doctor")
    page = Path(__file__).with_name("refusals.md").resolve()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        prepare()
        half_done(Path("begun.h5"), Path("begun.h5.part"))
        for case, spoil in corpus(seed)[:most]:
            spoil(Path("train.h5"), Path("bad.h5"))
            refused = through(case, "doctor", spoil, tallies).status == 2
            for name in islice(others, IN_TURN) if refused else WHERE_READ:
                through(case, name, spoil, tallies)
            page.write_text(table(tallies, seed), encoding="utf-8")


def through(case: str, name: str, spoil: Callable[[Path, Path], Path], tallies: dict[str, Tally]) -> Outcome:
    """One case through one command; where that goes on with a half-done recording, this is made bad alike."""
    for left in Path().glob("half*"):
        left.unlink()
    spoil(Path("begun.h5.part"), part_of(Path("half.h5")))
    outcome = ended(COMMANDS[name], Path("said.txt"))
    tallies[name].add(case, outcome)
    return outcome


def table(tallies: dict[str, Tally], seed: int) -> str:
    """The page: a row for each command, then every case that broke the rule."""
    head = ("command", "cases", "carried out", "refused", "longest refusal (s)", "most memory (GB)", "broke the rule")
    rows = [f"| {' | '.join(head)} |", "|" + " --- |" * len(head)]
    for name, tally in tallies.items():
        counts = f"{tally.cases} | {tally.cases - tally.refused} | {tally.refused}"
        numbers = f"{tally.longest_refusal_s:.2f} | {tally.most_bytes / 2**30:.2f} | {len(tally.broken)}"
        rows.append(f"| {name} | {counts} | {numbers} |")
    broken = [f"- {name}: {line}" for name, tally in tallies.items() for line in tally.broken]
    cases = tallies["doctor"].cases
    about = f"`python experiments/bench/refusals.py {cases} {seed}`. Processor time beyond loading the program."
    return "\n".join([about, "", *rows, "", *broken]) + "\n"


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:3]))
