"""Parameters that mean the same whatever form an effect is given, so that a diagnosis's values can be held to them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ertskin.hardware.virtual.bench import Truth


def parameters(truth: Truth, name: str) -> dict[str, float]:
    """True values, by the diagnosis's names, of the form-free parameters of one hidden effect; none for most."""
    hidden = truth.parameters(name)
    if hidden is None:
        return {}
    found = _FORM_FREE.get(name)
    return {} if found is None else found(hidden)


def _anisotropy(hidden: dict[str, Any]) -> dict[str, float]:
    stretch, angle = hidden["log_ratio"], 2 * hidden["angle_rad"]
    return {"stretch_x": stretch * np.cos(angle), "stretch_diagonal": stretch * np.sin(angle)}


_FORM_FREE = {
    "channel_gain": lambda hidden: {"gain": hidden["gain"], "offset_v": hidden["offset_v"]},
    "crosstalk": lambda hidden: {"fraction": hidden["share"]},
    "electrode_displacement": lambda hidden: dict(zip(("dx_m", "dy_m"), hidden["shift_m"], strict=True)),
    "indenter_offset": lambda hidden: {
        "dx_m": hidden["shift_m"][0],
        "dy_m": hidden["shift_m"][1],
        "rotation_rad": hidden["turn_rad"],
    },
    "sheet_anisotropy": _anisotropy,
    "temperature_drift": lambda hidden: {"rate_per_h": 3600.0 * hidden["final_share"] / hidden["settle_s"]},
}
