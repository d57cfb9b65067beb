"""What a diagnosis found, with all that its report draws from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import Diagnosis, HeldOut
from ertskin.diagnosis.judge.axis_tests import AxisTest
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Selection

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Drawing = tuple[str, str, Callable[[], "Figure"]]
"""Title, caption, what draws it."""


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


@dataclass(frozen=True, eq=False)
class DrawnFindings(Findings):
    """Findings about a partial recording, with the figures that show them."""

    drawings: tuple[Drawing, ...] = ()


def refused(name: str, reason: str) -> Findings:
    """Findings of a recording ``name`` that can't tell anything, for this reason."""
    return Findings(Diagnosis(name, "cannot_tell", HeldOut("none", None, None, None, None), reason=reason))
