"""What an effect may change, stage by stage; every hook leaves things as they are unless an effect says otherwise.

An effect is switched on by ``size``; 0 is none of it. What it draws (places, channels, directions) it draws from its
own generator in ``draw``, so that the same seed gives the same effect at every size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .foam import FoamPart
    from .sheet import Electrodes
    from .skin import Skin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moment:
    """An instant of a recording at which the skin's state is wanted.

    ``since_s`` to the moment before; ``position_m`` (P,2) and ``depth_m`` (P,) of the indenters, of none in air;
    ``frame`` and ``within`` (0 to 1, how far into its scan) where the sheet is to be solved, else frame -1.
    """

    time_s: float
    since_s: float
    press: int
    phase: int
    position_m: Array
    depth_m: Array
    frame: int = -1
    within: float = 0.5


class Effect:
    """No effect at all; subclasses override what they change."""

    name: ClassVar[str] = ""
    form: ClassVar[str] = ""
    source: ClassVar[str] = ""
    listed: ClassVar[bool] = True
    largest: ClassVar[float] = 1.0
    """Size beyond which the form means nothing."""
    bends: ClassVar[bool] = False
    """Whether the sheet far from a press changes during it otherwise than straight in time and in force."""

    def __init__(self, size: float) -> None:
        self.size = float(size)
        self.details: dict[str, Any] = {}

    def draw(self, skin: Skin, rng: np.random.Generator) -> None:
        """Settle places, channels and directions on this skin, in ``details`` (what the sealed truth will say)."""

    def start(self, points: int) -> None:
        """Forget everything; memory is wanted for this many places of the sheet."""

    # ------------------------------------------------------------------------------------------- mechanics
    def electrodes(self, electrodes: Electrodes) -> Electrodes:
        """Where the electrodes really are."""
        return electrodes

    def moved(self, moments: list[Moment]) -> list[Moment]:
        """What the stage really does."""
        return moments

    def foam(self) -> FoamPart | None:
        """What the foam does to the force, with its own memory."""
        return None

    def footprint(self, offset_m: Array, share: Array, force_n: float, moment: Moment) -> tuple[Array, Array]:
        """Offsets (n,2) and shares (n,) of the point forces that make up one indenter."""
        return offset_m, share

    def measured_force(self, force_n: Array, moments: list[Moment]) -> Array:
        """What the load cell says, (n,P) of the true force."""
        return force_n

    # --------------------------------------------------------------------------------------------- fabric
    def pressure(self, point_m: Array, pressure_pa: Array, moment: Moment) -> Array:
        """Pressure that really reaches the piezoresistive pair at (n,2)."""
        return pressure_pa

    def felt(self, pressure_pa: Array, since_s: float) -> Array:
        """Pressure that the pair answers to, given its past."""
        return pressure_pa

    def gain(self, log_gain: Array, pressure_pa: Array, since_s: float) -> Array:
        """Logarithm of conductance over that at rest, given its past."""
        return log_gain

    def sensitivity(self, point_m: Array) -> Array | None:
        """Factor on the logarithm of the conductance gained under pressure, by place."""
        return None

    # ---------------------------------------------------------------------------------------------- sheet
    def sheet(self, point_m: Array, moment: Moment) -> Array | None:
        """Logarithm of conductance over nominal, by place and time."""
        return None

    def direction(self, point_m: Array, pressure_pa: Array) -> Array | None:
        """(n,2,2) factor on the conductance, for sheets that conduct better one way."""
        return None

    def contact(self, contact_ohm: Array, moment: Moment) -> Array:
        """Contact resistance of each electrode."""
        return contact_ohm

    def admittance(self, admittance: Array, pressure_pa: Array) -> Array:
        """Specific admittance (S/m2) at places of pads under pressure."""
        return admittance

    # ---------------------------------------------------------------------------------------- instrument
    def network(self, transfer_ohm: Array, moment: Moment) -> Array:
        """Transfer matrix as wires and shunts outside the sheet leave it."""
        return transfer_ohm

    def voltage(self, voltage_v: Array, frame: int, time_s: float) -> Array:
        """(K,M) readings of one scan, in the order they are taken."""
        return voltage_v

    def recorded(self, voltage_v: Array, moving: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        """(T,K,M) readings of the whole recording, where scans bear on one another."""
        return voltage_v

    def meaning(self, skin: Skin) -> dict[str, float]:
        """Quantities with a meaning in any form, for judging intervals."""
        return {}
