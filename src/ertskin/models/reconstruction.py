"""A trained reconstruction: from the readings of a scan to touches, in one file that executes nothing when loaded."""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from ertskin.errors import UserError
from ertskin.models.denoiser import Denoiser
from ertskin.models.estimate import Estimate
from ertskin.models.monitor import SkinMonitor
from ertskin.models.network import Network
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]
FORMAT, FORMAT_VERSION = "ertskin-model", 1
FRAMES_AT_ONCE = 1024


@dataclass(eq=False)
class Reconstruction:
    """A network, the denoiser before it where it has one, and the protocol of the scans they read.

    ``about``: plain data on where it comes from. ``monitor``: by which the skin is followed and strange frames are
    recognised; none where the recording it learned from had too few rest frames.
    """

    protocol: Protocol
    network: Network
    denoiser: Denoiser | None = None
    about: dict[str, Any] = field(default_factory=dict)
    monitor: SkinMonitor | None = None

    def estimate(self, change_v: Array) -> Estimate:
        """Touches of (N,K,M) or (N,R) changes of the raw readings against rest, in volt."""
        flat = np.asarray(change_v).reshape(len(change_v), -1)
        if self.network.reads == "coordinates":
            return self._run(flat @ self.protocol.orthonormal)
        return self._run(flat)

    def estimate_coordinates(self, change_v: Array) -> Estimate:
        """Touches of (N,P) whitened coordinates of the change, in volt, as ``despiked`` gives them."""
        if self.network.reads == "coordinates":
            return self._run(change_v)
        return self._run(change_v @ self.protocol.orthonormal.T)

    def save(self, path: Path) -> None:
        """Write the file, aside and then in place."""
        content = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "protocol": {
                "injection_current_a": torch.from_numpy(np.ascontiguousarray(self.protocol.injection_current_a)),
                "measurement": torch.from_numpy(np.ascontiguousarray(self.protocol.measurement)),
            },
            "network": _packed(self.network),
            "denoiser": None if self.denoiser is None else _packed(self.denoiser),
            "about": self.about,
            "monitor": {} if self.monitor is None else _tensors(self.monitor.held()),
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_name(path.name + ".part")
        torch.save(content, aside)
        os.replace(aside, path)

    @classmethod
    def load(cls, path: Path) -> Reconstruction:
        """Read a file ``save`` wrote; raises ``UserError`` for anything else."""
        if not path.is_file():
            raise UserError(f"no model at {path}")
        try:
            content = torch.load(path, weights_only=True, map_location="cpu")
        except Exception as error:
            raise UserError(f"{path} is no model file: {str(error).splitlines()[0]}") from error
        found = (content.get("format"), content.get("format_version")) if isinstance(content, dict) else None
        if found != (FORMAT, FORMAT_VERSION):
            raise UserError(f"{path} has format {found}, expected {(FORMAT, FORMAT_VERSION)}")
        protocol = Protocol(*(content["protocol"][key].numpy() for key in ("injection_current_a", "measurement")))
        denoiser = None if content["denoiser"] is None else _unpacked(content["denoiser"], path)
        if denoiser is not None and not isinstance(denoiser, Denoiser):
            raise UserError(f"{path} names {type(denoiser).__name__} as its denoiser, which it isn't")
        monitor = SkinMonitor.of({name: value.numpy() for name, value in content.get("monitor", {}).items()})
        return cls(protocol, _unpacked(content["network"], path), denoiser, content["about"], monitor)

    @torch.inference_mode()
    def _run(self, change_v: Array) -> Estimate:
        modules: list[nn.Module] = [self.network] if self.denoiser is None else [self.denoiser, self.network]
        for module in modules:
            module.eval()
        parts = []
        for start in range(0, len(change_v), FRAMES_AT_ONCE):
            inputs = torch.from_numpy(np.asarray(change_v[start : start + FRAMES_AT_ONCE], dtype=np.float32))
            parts.append(self.network.estimate(inputs if self.denoiser is None else self.denoiser(inputs)))
        return stacked(parts)


def stacked(parts: list[Estimate]) -> Estimate:
    """The frames of all parts, in order; contacts padded with NaN."""
    force_map_n = np.concatenate([part.force_map_n for part in parts])
    present = np.concatenate([part.present for part in parts])
    most = max((0 if part.contact_force_n is None else part.contact_force_n.shape[1]) for part in parts)
    given = [name for name in CONTACT_FIELDS if all(getattr(part, name) is not None for part in parts)]
    joined = {name: np.concatenate([_widened(getattr(part, name), name, most) for part in parts]) for name in given}
    return Estimate(force_map_n, present, **joined)


CONTACT_FIELDS = ("contact_m", "contact_force_n", "covariance", "probability", "misfit")


def _widened(values: Array, name: str, most: int) -> Array:
    """An answer with room for ``most`` contacts in each frame, NaN where there are fewer."""
    if name == "misfit":
        return values
    pad = [(0, 0), (0, most - values.shape[1]), *[(0, 0)] * (values.ndim - 2)]
    return np.pad(values, pad, constant_values=np.nan)


def _tensors(held: dict[str, Any]) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(np.array(value)) for name, value in held.items()}


def _packed(network: Network) -> dict[str, Any]:
    kind = type(network)
    return {
        "target": f"{kind.__module__}.{kind.__qualname__}",
        "arguments": network.arguments,
        "state": {name: value.cpu() for name, value in network.state_dict().items()},
    }


def _unpacked(packed: dict[str, Any], path: Path) -> Network:
    """Build the network a file names: a class of ``ertskin.models``, nothing else is called."""
    module, _, name = str(packed["target"]).rpartition(".")
    kind = None
    if module.startswith("ertskin.models."):
        kind = getattr(importlib.import_module(module), name, None)
    if not (isinstance(kind, type) and issubclass(kind, Network)):
        raise UserError(f"{path} names the network '{packed['target']}', which ertskin doesn't have")
    try:
        network = kind(**packed["arguments"])
        network.load_state_dict(packed["state"])
    except (TypeError, RuntimeError) as error:
        raise UserError(f"{path} holds a {name} of another version of ertskin: train it again") from error
    return network.eval()
