"""What a diagnosis found, with all that its report draws from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Diagnosis
from ertskin.diagnosis.judge.axis_tests import AxisTest
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Selection

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything the report draws from: the answer, the evidence and the models before and after.

    Residuals (T,P) of the held-out frames in units of the noise: of the uncorrected simulator and with the terms named.
    ``whole``: what was fitted to all presses, where they are few.
    """

    diagnosis: Diagnosis
    evidence: Evidence | None = None
    baseline: Baseline | None = None
    selection: Selection | None = None
    held: NDArray[np.intp] | None = None
    residual_before: Array | None = None
    residual_after: Array | None = None
    tests_before: tuple[AxisTest, ...] = ()
    tests_after: tuple[AxisTest, ...] = ()
    whole: Selection | None = None

    @property
    def handed_on(self) -> Selection | None:
        """What the effects to be simulated come from."""
        return self.selection if self.whole is None else self.whole
