"""The discount of evidence that old samples ask for, from what is committed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from discount import FIRST, Doubted, doubted, log_likelihood, over_first
from judged import Judged
from opened_sample import judged, opened

from ertskin.diagnosis.contract.claims import confidences
from ertskin.diagnosis.criteria import Criteria

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
SAMPLES = sorted(one.parent for one in (CONCEALED / "results").glob("*/opened.json.xz"))


@pytest.fixture(scope="module")
def cases() -> list[Judged]:
    return [case for sample in SAMPLES for case in judged(sample, opened(sample))["ertskin"]]


def test_claims_made_by_a_discount_come_out_again(cases: list[Judged]) -> None:
    found = [(one, case.diagnosis["criteria"]["evidence_discount"]) for case in cases for one in doubted(case)]
    assert len(found) > 50
    for one, made_by in found:
        assert one.probability(made_by) == pytest.approx(one.stated, abs=0.011)


def test_it_reckons_as_the_diagnosis_does() -> None:
    short = {"one": 3.0, "other": 12.0}
    for discount in (2.0, 5.0, 10.0):
        expected = confidences(tuple(short.items()), Criteria(evidence_discount=discount))[0]
        assert Doubted(tuple(short.values()), 1.0, expected, True).probability(discount) == pytest.approx(expected)


def test_the_likeliest_is_the_one_that_claims_were_drawn_by() -> None:
    rng, true = np.random.default_rng(0), 5.0
    short = rng.uniform(0.0, 30.0, (2000, 3))
    chance = [Doubted(tuple(one), 1.0, 0.5, True).probability(true) for one in short]
    claims = [Doubted(tuple(one), 1.0, p, bool(rng.random() < p)) for one, p in zip(short, chance, strict=True)]
    assert max((3.0, 5.0, 8.0), key=lambda discount: log_likelihood(claims, discount)) == true


def test_what_cases_drawn_anew_give_holds_what_all_give() -> None:
    claims = [Doubted((8.0,), 1.0, 0.7, True)] * 40 + [Doubted((8.0,), 1.0, 0.7, False)] * 10
    low, high = over_first([[one] for one in claims], 5.0)
    assert low < log_likelihood(claims, 5.0) - log_likelihood(claims, FIRST) < high


def test_the_criterion_is_within_what_the_samples_before_it_allow(cases: list[Judged]) -> None:
    before = [case for case in cases if case.diagnosis.get("criteria", {}).get("evidence_discount") == FIRST]
    claims = [one for case in before for one in doubted(case)]
    likely = {discount: log_likelihood(claims, discount) for discount in (3.0, 4.0, 5.0, 6.0, 8.0, 10.0)}
    assert likely[Criteria().evidence_discount] > max(likely.values()) - 1.0


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, str(CONCEALED / "proof/discount.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
