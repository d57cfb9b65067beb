"""A trained reconstruction as an ONNX file that takes raw readings: the same answers, without torch and fast.

Whatever is linear in front of the first nonlinearity is multiplied out once: the projection onto the reciprocal numbers
with the whitening, or the denoiser's last layer with the first one behind it. A frame then costs one thin matrix.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ertskin.errors import UserError
from ertskin.live.predictor import ABOUT, COORDINATES, TABLE_SUFFIX
from ertskin.models.contacts import ContactsNetwork
from ertskin.models.denoiser import Denoiser
from ertskin.models.masked import MaskedNetwork
from ertskin.models.network import Network
from ertskin.models.places import PlacesNetwork
from ertskin.models.reconstruction import Reconstruction
from ertskin.models.scaling import Standardise
from ertskin.models.touch import TouchNetwork
from ertskin.models.trunk import Trunk

OPSET = 17
INPUT = "change_v"


class Affine(nn.Module):
    """x @ matrix + offset."""

    matrix: Tensor
    offset: Tensor

    def __init__(self, matrix: Tensor, offset: Tensor) -> None:
        super().__init__()
        self.register_buffer("matrix", matrix)
        self.register_buffer("offset", offset)

    def forward(self, values: Tensor) -> Tensor:
        """(N,in) to (N,out)."""
        return values @ self.matrix + self.offset


class OfCoordinates(nn.Module):
    """A network on whitened coordinates, from (N,R) changes of the raw readings, then from (M,P) of the coordinates.

    Either may have no frames. Where the coordinates are known already, the readings' matrix is most of what a frame
    costs.
    """

    def __init__(self, network: Network, orthonormal: Tensor) -> None:
        super().__init__()
        trunk = network.trunk
        if not isinstance(trunk, Trunk):
            raise UserError(f"{type(network).__name__} has no trunk to export")
        whitening = orthonormal @ trunk.whiten.matrix.double()
        self.enter = Affine(whitening, torch.zeros(whitening.shape[1]))
        self.whiten = trunk.whiten
        self.network = network

    def forward(self, change_v: Tensor, coordinates_v: Tensor) -> tuple[Tensor, ...]:
        """What the network's layers give, the first as a probability."""
        return _answers(self.network, torch.cat([self.enter(change_v), self.whiten(coordinates_v)]))


class OfReadings(nn.Module):
    """A network on raw readings, from (N,R) changes, perhaps through a denoiser."""

    def __init__(self, network: MaskedNetwork, denoiser: Denoiser | None) -> None:
        super().__init__()
        self.network = network
        first, normalise = network.readings, network.first[1]
        inner = _scaled(network.scale, Affine(first.weight.detach().double(), first.bias.detach().double()))
        if denoiser is None:
            self.enter: nn.Module = inner
        else:
            into, batch, active, out = denoiser.layers
            begin = _scaled(denoiser.scale, _linear(into))
            end = _after(_unscaled(_linear(out), denoiser.scale), inner)
            self.enter = nn.Sequential(begin, batch, active, end)
        self.normalise = normalise

    def forward(self, change_v: Tensor) -> tuple[Tensor, ...]:
        """Probability and force of each taxel."""
        location, force = self.normalise(self.enter(change_v)).chunk(2, dim=1)
        return torch.sigmoid(self.network.location(location)), torch.relu(self.network.force(force))


def export_onnx(reconstruction: Reconstruction, path: Path) -> None:
    """Write the reconstruction to ``path``; raises ``UserError`` for a network that can't be exported."""
    protocol, network = reconstruction.protocol, reconstruction.network
    # Taken before the graph is made in single precision: what decides stays as exact as in training.
    arrays = {} if reconstruction.monitor is None else reconstruction.monitor.held()
    if isinstance(network, ContactsNetwork):
        arrays |= network.held() | {"least_force_n": network.least_force_n, "most": network.most}
    module = _module(reconstruction).eval().float()
    frames = [torch.zeros(1, protocol.shape[0] * protocol.shape[1])]
    inputs = [INPUT]
    if network.reads == "coordinates":
        frames.append(torch.zeros(1, protocol.orthonormal.shape[1]))
        inputs.append(COORDINATES)
    outputs = ["probability", "force_n"]
    if isinstance(network, PlacesNetwork):
        outputs.append("place_m")
    if isinstance(network, ContactsNetwork):
        outputs.append("whitened")
    aside = path.with_name(path.name + ".part")
    path.parent.mkdir(parents=True, exist_ok=True)
    # The exporter that needs no further package does not know this one function, which ONNX has.
    torch.onnx.register_custom_op_symbolic("aten::asinh", lambda graph, value: graph.op("Asinh", value), 9)
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            tuple(frames),
            str(aside),
            dynamo=False,
            opset_version=OPSET,
            input_names=inputs,
            output_names=outputs,
            dynamic_axes={name: {0: f"frames of {name}"} for name in inputs}
            | {name: {0: "frames"} for name in outputs},
        )
    _describe(aside, _about(reconstruction))
    _write_arrays(path.with_suffix(TABLE_SUFFIX), arrays)
    os.replace(aside, path)


def _module(reconstruction: Reconstruction) -> nn.Module:
    network = reconstruction.network
    if network.reads == "coordinates":
        orthonormal = torch.from_numpy(np.ascontiguousarray(reconstruction.protocol.orthonormal))
        return OfCoordinates(network, orthonormal)
    if isinstance(network, MaskedNetwork):
        return OfReadings(network, reconstruction.denoiser)
    raise UserError(f"{type(network).__name__} can't be exported to ONNX")


def _answers(network: Network, whitened: Tensor) -> tuple[Tensor, ...]:
    if isinstance(network, PlacesNetwork):
        logit, force, offset = network.layers_out(whitened)
        votes = torch.sigmoid(logit), force, network.taxel_m + network.spacing_m * offset
        return (*votes, whitened) if isinstance(network, ContactsNetwork) else votes
    if isinstance(network, TouchNetwork):
        logit, force = network.layers_out(whitened)
        return torch.sigmoid(logit), force
    raise UserError(f"{type(network).__name__} can't be exported to ONNX")


def _about(reconstruction: Reconstruction) -> dict[str, Any]:
    network = reconstruction.network
    kind = "places" if isinstance(network, PlacesNetwork) else "touch"
    contacts = isinstance(network, ContactsNetwork)
    return {
        "kind": "contacts" if contacts else kind,
        "shape": list(reconstruction.protocol.shape),
        "taxel_m": network.answers_m.tolist(),
        "threshold": float(network.threshold),  # type: ignore[arg-type]
        "spacing_m": float(network.spacing_m) if isinstance(network, PlacesNetwork) else None,
        "run_id": reconstruction.about.get("run_id"),
    }


def _write_arrays(path: Path, held: dict[str, Any]) -> None:
    """What the graph can't hold: the monitor, and the forward model that decides what it proposes."""
    if not held:
        return
    aside = path.with_name(path.name + ".part")
    with aside.open("wb") as stream:
        np.savez(stream, **held)
    os.replace(aside, path)


def _describe(path: Path, about: dict[str, Any]) -> None:
    """Keep beside the graph what its numbers mean; coordinates need not be given."""
    import onnx

    model = onnx.load(str(path))
    for entered in model.graph.input[1:]:
        none = np.zeros((0, entered.type.tensor_type.shape.dim[1].dim_value), dtype=np.float32)
        model.graph.initializer.append(onnx.numpy_helper.from_array(none, entered.name))
    entry = model.metadata_props.add()
    entry.key, entry.value = ABOUT, json.dumps(about)
    onnx.save(model, str(path))


def _linear(layer: nn.Module) -> Affine:
    assert isinstance(layer, nn.Linear)
    offset = torch.zeros(layer.out_features) if layer.bias is None else layer.bias
    return Affine(layer.weight.detach().T.double(), offset.detach().double())


def _scaled(scale: Standardise, layer: Affine) -> Affine:
    """A layer with the scaling in front of it taken in."""
    mean, std = scale.mean.double(), scale.std.double()
    return Affine(layer.matrix / std[:, None], layer.offset - (mean / std) @ layer.matrix)


def _unscaled(layer: Affine, scale: Standardise) -> Affine:
    """A layer with the scaling back behind it taken in."""
    std = scale.std.double()
    return Affine(layer.matrix * std, layer.offset * std + scale.mean.double())


def _after(first: Affine, second: Affine) -> Affine:
    """Two layers in one."""
    return Affine(first.matrix @ second.matrix, first.offset @ second.matrix + second.offset)
