"""A suite published part by part: what binds only grows, and nothing can be scored before the last part is open.

And recorded by kernels that any machine has, for the same bytes.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import seals
from opened_sample import METHOD, judged, opened
from publish import commit, reveal
from record import commitments, skin_of, truth_of
from suite import Case, suite

SECRET = bytes(range(32))
NULLS = [case for case in suite(SECRET, [], small=True) if not case.hidden]
PARTS = NULLS[:2], NULLS[2:]
Truths = dict[str, dict[str, object]]


@pytest.fixture(scope="module")
def truths() -> Truths:
    return {case.name: truth_of(case, skin_of(case))[0] for case in NULLS}


def recorded(out: Path, part: list[Case], truths: Truths, secret: bytes = SECRET) -> Path:
    """A folder as ``record.py`` leaves it, that holds one part alone."""
    shutil.rmtree(out, ignore_errors=True)
    (out / "recordings").mkdir(parents=True)
    (out / "secret.txt").write_text(secret.hex() + "\n")
    for case in part:
        sealed = {"truth": truths[case.name], "nonce": seals.nonce(secret, case.name)}
        seals.write_json(out / "sealed" / f"{case.name}.json", sealed)
        (out / "recordings" / f"{case.name}.h5").write_bytes(case.name.encode())
    about = {"families": [], "small": True}
    seals.write_json(out / "commitments.json", commitments(out, NULLS, secret, about))
    return out


def diagnosed(out: Path, part: list[Case], verdict: str = "no_mismatch", method: str = METHOD) -> Path:
    """The folder as ``diagnose.py`` leaves it."""
    for case in part:
        said = {"format": "ertskin-diagnosis", "format_version": 1, "verdict": verdict, "effects": []}
        seals.write_json(out / "diagnoses" / method / case.name / "diagnosis.json", said)
    return out


def test_parts_add_up_and_open_with_the_last(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    for number, part in enumerate(PARTS):
        last = number == len(PARTS) - 1
        commit(recorded(out, part, truths), results)
        assert reveal(diagnosed(out, part), results, more=not last, sample=last) == []
        if not last:
            with pytest.raises(seals.SealError, match=r"opened\.json\.xz: found no such file"):
                opened(results)
    assert sorted(path.name for path in results.iterdir()) == [
        "commitments.json", "diagnoses.json.xz", "isolated_laws.json", "opened.json.xz"
    ]  # fmt: skip
    found = opened(results)
    assert set(found) == {case.name for case in NULLS}
    assert {one.name: one.verdict for one in judged(results, found)[METHOD]} == dict.fromkeys(found, "no_mismatch")


def test_a_suite_that_lacks_a_part_does_not_open(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    commit(recorded(out, PARTS[0], truths), results)
    commit(recorded(out, PARTS[1], truths), results)
    with pytest.raises(seals.SealError, match=f"no truth of {PARTS[0][0].name}, {PARTS[0][1].name}"):
        reveal(diagnosed(out, PARTS[1]), results, sample=True)
    assert not (results / "opened.json.xz").exists()


def test_the_secret_stays_while_cases_it_draws_are_not_committed(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    commit(recorded(out, NULLS, truths), results)
    drawn = len(suite(SECRET, [], small=True))
    with pytest.raises(seals.SealError, match=f"{drawn - len(NULLS)} of the suite's {drawn} cases aren't committed"):
        reveal(diagnosed(out, NULLS), results)
    assert not (results / "opened.json.xz").exists()
    (out / "secret.txt").write_text(bytes(32).hex())
    with pytest.raises(seals.SealError, match="not the secret committed to"):
        reveal(out, results, sample=True)


def test_what_is_committed_stays_as_it_is(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    commit(recorded(out, PARTS[0], truths), results)
    before = (results / "commitments.json").read_bytes()
    with pytest.raises(seals.SealError, match="a case is committed once"):
        commit(out, results)
    again = seals.read_json(out / "commitments.json")
    again["cases"][PARTS[0][0].name]["recording"] = "0" * 64
    seals.write_json(out / "commitments.json", again)
    with pytest.raises(seals.SealError, match=f"{PARTS[0][0].name} published already, as something else"):
        commit(out, results)
    with pytest.raises(seals.SealError, match="another secret or suite"):
        commit(recorded(out, PARTS[1], truths, secret=bytes(32)), results)
    with pytest.raises(seals.SealError, match=f"{PARTS[1][0].name}.* diagnosed before being committed to"):
        commit(diagnosed(recorded(out, PARTS[1], truths), PARTS[1]), results)
    assert (results / "commitments.json").read_bytes() == before


def test_nothing_is_committed_to_once_the_secret_is_out(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    commit(recorded(out, PARTS[0], truths), results)
    reveal(diagnosed(out, PARTS[0]), results, sample=True)
    with pytest.raises(seals.SealError, match="open already; nothing more"):
        commit(recorded(out, PARTS[1], truths), results)
    with pytest.raises(seals.SealError, match="open already; --more"):
        reveal(out, results, more=True)


def test_of_a_part_only_what_was_diagnosed_is_opened(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    commit(recorded(out, NULLS[:3], truths), results)
    diagnosed(out, NULLS[:1], method="rival")
    diagnosed(out, NULLS[1:3])
    slow, done = (out / "diagnoses" / METHOD / case.name / "diagnosis.json" for case in NULLS[1:3])
    slow.rename(slow.with_name("stopped.txt"))
    assert reveal(out, results, more=True) == [slow.parent.name]
    assert set(seals.read_json(results / "opened_so_far.json.xz")) == {slow.parent.name, done.parent.name}
    assert set(seals.read_json(results / "diagnoses.json.xz")[METHOD]) == {done.parent.name}


def test_answers_stay_as_they_were_when_truths_were_opened(tmp_path: Path, truths: Truths) -> None:
    out, results = tmp_path / "out", tmp_path / "results"
    part = NULLS[:2]
    commit(recorded(out, part, truths), results)
    diagnosed(out, part)
    slow = out / "diagnoses" / METHOD / part[0].name / "diagnosis.json"
    slow.rename(slow.with_name("stopped.txt"))
    reveal(out, results, more=True)
    assert set(seals.read_json(results / "diagnoses.json.xz")[METHOD]) == {part[1].name}
    before = (results / "diagnoses.json.xz").read_bytes()
    for changed, verdict in ((part[:1], "no_mismatch"), (part[1:], "unexplained")):
        with pytest.raises(seals.SealError, match=f"{changed[0].name} answered otherwise"):
            reveal(diagnosed(recorded(out, part, truths), changed, verdict), results, more=True)
    assert (results / "diagnoses.json.xz").read_bytes() == before
    reveal(diagnosed(recorded(out, part, truths), part, method="rival"), results, more=True)
    said = seals.read_json(results / "diagnoses.json.xz")
    assert {method: set(found) for method, found in said.items()} == {
        METHOD: {part[1].name}, "rival": {case.name for case in part}
    }  # fmt: skip


KERNELS = """
import json, runpy, sys
sys.argv = ["record.py", "--help"]
sys.path.insert(0, {folder!r})
try:
    runpy.run_path({folder!r} + "/record.py", run_name="__main__")
except SystemExit:
    pass
import threadpoolctl
from numpy._core._multiarray_umath import __cpu_features__
blas = [pool["architecture"] for pool in threadpoolctl.threadpool_info() if pool["internal_api"] == "openblas"]
print(json.dumps([blas, __cpu_features__.get("X86_V4", False)]))
"""


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the kernels asked for are those of x86-64 with AVX2")
def test_recordings_are_made_by_kernels_that_other_machines_have() -> None:
    program = KERNELS.format(folder=str(Path(seals.__file__).parent))
    chosen = {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"}
    environment = {key: value for key, value in os.environ.items() if key not in chosen}
    asked = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment)
    blas, wide = json.loads(asked.stdout.splitlines()[-1])
    assert blas
    assert set(blas) == {"Haswell"}
    assert not wide
