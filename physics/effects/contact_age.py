"""How long contacts have stayed as they are: their age grows with time and is lost where they slip."""

from __future__ import annotations

import numpy as np
from numba import njit

from ertskin.physics.effects.effect import Array


def contact_age_s(pressure_pa: Array, time_s: Array, slip: float) -> Array:
    """(T,N) seconds, a: a' = 1 - a |p'|/(slip p), exactly where the logarithm of the pressure (T,N) goes straight.

    Contacts slip as the pressure on them changes, and a relative change by ``slip`` renews most of them: the ageing law
    of rate- and state-dependent friction (Ruina, J. Geophys. Res. 88 (1983) 10359) under changing normal stress
    (Linker & Dieterich, J. Geophys. Res. 97 (1992) 4923). What is not pressed has no contact, and so no age. Noise in
    the pressure renews contacts too: give it what a fit makes of the force, not the load cell's readings.
    """
    age_s = np.zeros(pressure_pa.shape)
    _grow(age_s, np.ascontiguousarray(pressure_pa), np.diff(time_s, prepend=time_s[0]), slip)
    return age_s


@njit(cache=True, nogil=True)
def _grow(age_s, pressure, step_s, slip):  # type: ignore[no-untyped-def]
    for t in range(1, len(pressure)):
        for n in range(pressure.shape[1]):
            before, now = pressure[t - 1, n], pressure[t, n]
            if before <= 0 or now <= 0:
                continue
            slipped = abs(np.log(now / before)) / slip
            if slipped == 0:
                age_s[t, n] = age_s[t - 1, n] + step_s[t]
            else:
                age_s[t, n] = np.exp(-slipped) * age_s[t - 1, n] - np.expm1(-slipped) / slipped * step_s[t]
