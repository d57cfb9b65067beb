"""Whether the specimen and the skin remember alike: they are two pieces of fabric, and needn't."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.specimen.fit import SpecimenTest
from ertskin.diagnosis.specimen.signal import SpecimenSignal
from ertskin.physics.effects.effect import Effect, PiezoEffect
from ertskin.physics.effects.hypothesis import Axis


def remembers_alike(specimen: SpecimenSignal, effects: Sequence[Effect], criteria: Criteria) -> bool:
    """Whether what the skin's ``effects`` make of the fabric is what the specimen shows, the law fitted anew."""
    # Where on the sheet the specimen would lie nobody knows.
    skin = [e for e in effects if isinstance(e, PiezoEffect) and Axis.PLACE not in e.hypothesis.axes]
    test = SpecimenTest(specimen.stress_pa, specimen.resistance_ohm_sq, specimen.time_s)

    def mean_square(chain: Sequence[PiezoEffect]) -> float:
        return float((test.residual(chain) ** 2).mean())

    own = mean_square(specimen.effects)
    wrong = np.sqrt(max(mean_square(skin) - own, 0.0))
    size = np.sqrt(max(mean_square(()) - own, 0.0))
    return bool(wrong <= criteria.specimen_difference * max(size, np.sqrt(own)))
