"""Every form of every listed effect, by the name a diagnosis should give it."""

from __future__ import annotations

from . import conduction, electrodes, fabric, instrument, mechanics
from .effect import Effect

FORMS: dict[str, tuple[type[Effect], ...]] = {
    "nonlinear_foam": (mechanics.DensifyingFoam, mechanics.HyperFoam),
    "viscoelastic_foam": (mechanics.FractionalFoam, mechanics.QuasilinearFoam),
    "foam_hysteresis": (mechanics.BoucWenFoam, mechanics.EnergyUnloadingFoam),
    "foam_softening": (mechanics.OgdenRoxburghFoam, mechanics.DamagedFoam),
    "indenter_offset": (mechanics.TurnedStage, mechanics.SkewedStage),
    "piezo_hysteresis": (fabric.AdheringFabric, fabric.DuhemFabric),
    "piezo_creep": (fabric.StretchedCreep, fabric.FractionalCreep, fabric.AgeingCreep),
    "piezo_inhomogeneity": (
        fabric.SeamSensitivity, fabric.LotSensitivity, fabric.WrinkledSensitivity, fabric.HillSensitivity,
    ),
    "sheet_anisotropy": (conduction.TwoYarnSheet, conduction.BowedSheet),
    "sheet_inhomogeneity": (
        conduction.RollSheet, conduction.SeamSheet, conduction.GradientSheet, conduction.HillSheet,
    ),
    "temperature_drift": (conduction.WarmingSheet, conduction.LoadWarmedSheet),
    "self_heating": (conduction.ScanHeatedSheet, conduction.SpreadHeatSheet),
    "contact_pressure_dependence": (electrodes.HolmContact, electrodes.MikicContact, electrodes.PercolatingContact),
    "electrode_displacement": (electrodes.SlidPad, electrodes.PulledThread),
    "contact_drift": (electrodes.OxidisingContacts, electrodes.SettlingContacts),
    "channel_gain": (instrument.GainAndOffset, instrument.WarmingGain),
    "crosstalk": (instrument.SettlingMultiplexer, instrument.SoakingDielectric),
    "adc_saturation": (instrument.HardLimit, instrument.SoftLimit),
    "scan_skew": (instrument.RunningStage, instrument.LaggingStage),
}  # fmt: skip
"""In the order of the table of names: pad, pair, sheet, electrodes, instrument."""
